//! The 54 runs of NIST's nonlinear reference problems, one default setting, derivatives by differences.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use crate::strd;
use precut_calc::num::lsq::{Ending, Noise};

#[test]
fn nist_problems_are_solved_from_both_starts() {
    let Some(problems) = strd::problems() else { return };
    let mut counts = [0; 3];
    println!("| problem | start | digits: parameters | deviations | sum of squares | steps | calls | offset |");
    println!("|---|---|---|---|---|---|---|---|");
    for problem in &problems {
        for start in 0..2 {
            let fit = problem.solve(start).unwrap();
            let digits = problem.digits(&fit.parameters);
            let covariance = fit.covariance(Noise::FromResiduals);
            let deviations: Vec<f64> = covariance.standard_deviations.iter().map(|sd| sd.unwrap_or(f64::NAN)).collect();
            let sd_digits = strd::common_digits(&deviations, &problem.standard_deviations);
            let rss_digits = strd::common_digits(&[fit.sum_of_squares], &[problem.rss]);
            println!(
                "| {} | {} | {digits:.1} | {sd_digits:.1} | {rss_digits:.1} | {} | {} | {:.1e} {:?} |",
                problem.name,
                start + 1,
                fit.iterations,
                fit.evaluations,
                fit.relative_offset,
                fit.ending
            );
            for (count, wanted) in counts.iter_mut().zip([4.0, 6.0, 8.0]) {
                *count += i32::from(digits >= wanted);
            }
            assert!(fit.ending != Ending::Converged || digits >= 6.0, "{} passes as converged", problem.name);
        }
    }
    println!("solved to 4 / 6 / 8 digits: {} / {} / {} of 54", counts[0], counts[1], counts[2]);
    assert!(counts[0] >= 54 && counts[1] >= 54 && counts[2] >= 54, "{counts:?}");
}
