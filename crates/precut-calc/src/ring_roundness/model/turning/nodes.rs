//! A closed profile on uniform angles, with ghosts at both ends so that no reading wraps.

/// Values at the body angles 2πk/n, k = 0..n.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Nodes {
    n: usize,
    pad: usize,
    values: Vec<f64>,
}

/// Where between two nodes a reading falls: the node below and the share of the way to the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub node: usize,
    pub share: f64,
}

/// Ghosts that the cubic through four nodes needs.
pub(super) const CUBIC_PAD: usize = 3;

/// Adding and taking it away rounds a double below 2^31 to a whole number, which stands in its low bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

impl Place {
    /// Of a position in nodes, 0 <= position < n.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "the low half of the bits is the whole number")]
    pub(super) fn of(position: f64, n: usize) -> Self {
        let shifted = position - 0.5 + ROUNDER;
        let below = shifted - ROUNDER;
        // Neither a not-a-number nor the upper end may lead out of the ghosts.
        let node = (shifted.to_bits() as u32 as usize).min(n);
        Self { node, share: position - below }
    }
}

impl Nodes {
    /// With `pad` ghosts at either end, at least those of the cubic and at most n.
    pub(crate) fn new(values: &[f64], pad: usize) -> Self {
        let n = values.len();
        let pad = pad.max(CUBIC_PAD).min(n);
        let mut padded = Vec::with_capacity(n + 2 * pad);
        padded.extend_from_slice(&values[n - pad..]);
        padded.extend_from_slice(values);
        padded.extend_from_slice(&values[..pad]);
        Self { n, pad, values: padded }
    }

    /// The values without ghosts.
    pub(crate) fn values(&self) -> &[f64] {
        &self.values[self.pad..self.pad + self.n]
    }

    pub(super) fn len(&self) -> usize {
        self.n
    }

    pub(super) fn pad(&self) -> usize {
        self.pad
    }

    #[inline]
    pub(super) fn get(&self, node: usize) -> f64 {
        self.values[self.pad + node]
    }

    #[inline]
    pub(super) fn set(&mut self, node: usize, value: f64) {
        self.values[self.pad + node] = value;
        if node < self.pad {
            self.values[self.pad + self.n + node] = value;
        }
        if node + self.pad >= self.n {
            self.values[node + self.pad - self.n] = value;
        }
    }

    /// The nodes from `node - half` to `node + half`; `half` is at most the pad.
    #[inline]
    pub(super) fn window(&self, node: usize, half: usize) -> &[f64] {
        &self.values[self.pad + node - half..=self.pad + node + half]
    }

    /// Value and slope per node of the cubic through the four nodes round a place.
    #[inline]
    pub(super) fn cubic(&self, place: Place) -> (f64, f64) {
        let at = self.pad + place.node - 1;
        let w = &self.values[at..at + 4];
        let t = place.share;
        let linear = w[2] - w[0] / 3.0 - 0.5 * w[1] - w[3] / 6.0;
        let square = 0.5 * (w[0] + w[2]) - w[1];
        let cube = (w[3] - w[0]) / 6.0 + 0.5 * (w[1] - w[2]);
        (((cube * t + square) * t + linear) * t + w[1], (3.0 * cube * t + 2.0 * square) * t + linear)
    }

    /// Smallest and largest value.
    pub(super) fn range(&self) -> (f64, f64) {
        self.values().iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubic_is_exact_for_cubics_also_across_the_seam() {
        let f = |x: f64| 2.0 - 0.3 * x + 0.02 * x * x - 0.001 * x * x * x;
        for seam in [0_u32, 3, 7] {
            // Values of the cubic about the place that is read, whatever node that is.
            let values: Vec<f64> = (0..10_u32).map(|k| f(f64::from((k + 10 - seam + 5) % 10) - 5.0)).collect();
            let nodes = Nodes::new(&values, 0);
            for share in [0.0, 0.25, 1.0] {
                let (value, slope) = nodes.cubic(Place::of(f64::from(seam) + share * 0.999_999, 10));
                let x = share * 0.999_999;
                assert!((value - f(x)).abs() < 1e-14);
                assert!((slope - (-0.3 + 0.04 * x - 0.003 * x * x)).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_place_of_nothing_is_within_the_ghosts() {
        let nodes = Nodes::new(&[1.0; 12], 0);
        for position in [f64::NAN, f64::INFINITY, -1e300, 11.999_999_999_999_999] {
            assert!((nodes.cubic(Place { share: 0.0, ..Place::of(position, 12) }).0 - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn ghosts_follow_their_nodes() {
        let mut nodes = Nodes::new(&[0.0; 12], 4);
        for node in 0..12_u32 {
            nodes.set(node as usize, f64::from(node));
        }
        assert_eq!(nodes.window(1, 4), &[9.0, 10.0, 11.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(nodes.window(10, 3), &[7.0, 8.0, 9.0, 10.0, 11.0, 0.0, 1.0]);
    }
}
