//! Cross-validation in closed form: no refit is needed to know what a fit without some rows predicts for them.

use super::Linear;
use crate::dense::{Columns, Qr};

/// Errors of prediction of every row from all others: e/(1 - h); `None` where the others do not determine the row.
pub fn leave_one_out(fit: &Linear) -> Vec<Option<f64>> {
    fit.residuals.iter().zip(&fit.leverages).map(|(e, h)| (1.0 - h > 1e-9).then(|| e / (1.0 - h))).collect()
}

/// Errors of prediction of every row from the rows of all other groups: (I - H_gg)^-1 e_g; `None` where these do not
/// determine it.
pub fn group_out(fit: &Linear, groups: &[Vec<usize>]) -> Vec<Option<f64>> {
    let mut errors = vec![None; fit.residuals.len()];
    for group in groups {
        let rows = fit.design().take_rows(group);
        let mut open = Columns::zeros(group.len(), 0);
        for k in 0..group.len() {
            let spread = fit.inverse_gram.times(&rows.row(k));
            let mut column: Vec<f64> = rows.times(&spread).iter().map(|h| -h).collect();
            column[k] += 1.0;
            open.push(&column);
        }
        let qr = Qr::pivoted(open);
        if qr.rank(1e-9) == group.len() && qr.r(0, 0).abs() > 1e-9 {
            let own: Vec<f64> = group.iter().map(|&i| fit.residuals[i]).collect();
            for (&i, error) in group.iter().zip(qr.solve(&own)) {
                errors[i] = Some(error);
            }
        }
    }
    errors
}
