//! Bytes out of text.

const BITS_OF_DIGIT: u32 = 6;

/// The bytes of standard base64, spaces and line ends passed over; else the place of the character that is none of its.
pub(super) fn decoded(text: &str) -> Result<Vec<u8>, usize> {
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let (mut held, mut bits) = (0_u32, 0);
    let mut ended = false;
    for (at, character) in text.bytes().enumerate() {
        let digit = match character {
            b'A'..=b'Z' => character - b'A',
            b'a'..=b'z' => character - b'a' + 26,
            b'0'..=b'9' => character - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                ended = true;
                continue;
            }
            b' ' | b'\t' | b'\r' | b'\n' => continue,
            _ => return Err(at),
        };
        if ended {
            return Err(at);
        }
        held = (held << BITS_OF_DIGIT) | u32::from(digit);
        bits += BITS_OF_DIGIT;
        if bits >= u8::BITS {
            bits -= u8::BITS;
            bytes.push(((held >> bits) & 0xff) as u8);
            held &= (1 << bits) - 1;
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::decoded;

    #[test]
    fn text_is_read_as_its_standard_has_it() {
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9v\nYmFy", "foobar")] {
            assert_eq!(decoded(text).as_deref(), Ok(bytes.as_bytes()));
        }
        assert_eq!(decoded("/+8="), Ok(vec![0xff, 0xef]));
        assert_eq!(decoded("Zm9v*"), Err(4));
        assert_eq!(decoded("Zg=="), Ok(vec![b'f']));
        assert_eq!(decoded("Zg==Zg"), Err(4));
    }
}
