//! How a number goes with others, as samples of them tell.

use nalgebra::{DMatrix, DVector};

/// Numbers that have changed by less than this over the samples, as a sum of squares, tell less than what is expected.
const EXPECTED: f64 = 0.02;

/// How a number goes with others, by least squares about the means, and where these hardly change as is expected.
pub(super) fn slopes<const S: usize>(samples: &[([f64; S], f64)], expected: [f64; S]) -> [f64; S] {
    let count = samples.len().max(1) as f64;
    let means: [f64; S] = std::array::from_fn(|k| samples.iter().map(|(near, _)| near[k]).sum::<f64>() / count);
    let mean = samples.iter().map(|(_, real)| real).sum::<f64>() / count;
    let expected = DVector::from_row_slice(&expected);
    let (mut products, mut with) = (DMatrix::<f64>::identity(S, S) * EXPECTED, DVector::<f64>::zeros(S));
    for (near, real) in samples {
        let off = DVector::from_fn(S, |k, _| near[k] - means[k]);
        with += &off * (real - mean - off.dot(&expected));
        products += &off * off.transpose();
    }
    let more = products.cholesky().map_or_else(|| DVector::zeros(S), |of| of.solve(&with));
    std::array::from_fn(|k| expected[k] + more[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_goes_with_others_by_its_slopes() {
        let near = |i: u32| [f64::from(i % 5), f64::from(i % 7), 0.3];
        let samples: Vec<([f64; 3], f64)> =
            (0..35).map(near).map(|near| (near, 4.0 + 3.0 * near[0] - 0.5 * near[1])).collect();
        let by = slopes(&samples, [1.0, 1.0, 0.7]);
        // What does not change goes as is expected; what does, by a sum of squares of 70 and more.
        for (found, expected) in by.iter().zip([3.0, -0.5, 0.7]) {
            assert!((found - expected).abs() < 1e-3, "{by:?}");
        }
    }
}
