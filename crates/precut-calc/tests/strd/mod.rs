//! NIST's reference problems of nonlinear least squares, read in place, and their models written as functions.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, dead_code, unreachable_pub, missing_docs)]

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use precut_calc::num::lsq::{Fit, NoFit, Parameter, Settings, fit, from_fn};
use serde_json::Value;

/// Where the tables lie; `None`, after saying so, where they are absent and may be.
pub fn folder() -> Option<PathBuf> {
    // Beside the repository's root, which is this package's folder or two above it.
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = package.ancestors().find(|folder| folder.join("Cargo.lock").is_file()).unwrap_or(package);
    let folder = root.join("../shared/reference/nist");
    if folder.join("strd_index.json").is_file() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "{} is absent", folder.display());
    println!("skipped: {} is absent", folder.display());
    None
}

/// A problem with its certified answer.
pub struct Problem {
    pub name: String,
    /// Response as fitted.
    pub y: Vec<f64>,
    /// Predictors, by rows.
    pub x: Vec<Vec<f64>>,
    pub starts: [Vec<f64>; 2],
    pub certified: Vec<f64>,
    pub standard_deviations: Vec<f64>,
    pub rss: f64,
    pub model: fn(&[f64], &[f64]) -> f64,
}

impl Problem {
    /// Fits from a start with the default setting, without derivatives.
    pub fn solve(&self, start: usize) -> Result<Fit, NoFit> {
        let model = from_fn(self.y.len(), |b, into| {
            for ((r, x), y) in into.iter_mut().zip(&self.x).zip(&self.y) {
                *r = (self.model)(b, x) - y;
            }
        });
        let parameters: Vec<Parameter> = self.starts[start].iter().map(|b| Parameter::free(*b)).collect();
        fit(&model, &parameters, &Settings::default())
    }

    /// Digits in which a fit agrees with the certificate in all parameters, at most the 11 certified ones.
    pub fn digits(&self, found: &[f64]) -> f64 {
        common_digits(found, &self.certified)
    }
}

/// Least log relative error, between 0 and 11.
pub fn common_digits(found: &[f64], certified: &[f64]) -> f64 {
    let worst = found
        .iter()
        .zip(certified)
        .map(|(f, c)| ((f - c) / c).abs())
        .fold(0.0_f64, |most, e| if e.is_nan() { f64::INFINITY } else { most.max(e) });
    if worst == 0.0 { 11.0 } else { (-worst.log10()).clamp(0.0, 11.0) }
}

pub fn problems() -> Option<Vec<Problem>> {
    let folder = folder()?;
    let read = |file: &str| -> Value { serde_json::from_slice(&std::fs::read(folder.join(file)).unwrap()).unwrap() };
    let index = read("strd_index.json");
    let problems = index["datasets"].as_array().unwrap().iter().map(|entry| {
        let set = read(entry["file"].as_str().unwrap());
        let rows: Vec<Vec<f64>> = serde_json::from_value(set["data"].clone()).unwrap();
        let column = |name: &str| -> Vec<f64> {
            set["parameters"].as_array().unwrap().iter().map(|p| p[name].as_f64().unwrap()).collect()
        };
        let name = set["dataset"].as_str().unwrap().to_owned();
        let logarithmic = set["response"] == "log(y)";
        Problem {
            y: rows.iter().map(|row| if logarithmic { row[0].ln() } else { row[0] }).collect(),
            x: rows.iter().map(|row| row[1..].to_vec()).collect(),
            starts: [column("start1"), column("start2")],
            certified: column("certified"),
            standard_deviations: column("standard_deviation"),
            rss: set["residual_sum_of_squares"].as_f64().unwrap(),
            model: model(&name),
            name,
        }
    });
    let problems: Vec<Problem> = problems.collect();
    assert_eq!(problems.len(), 27);
    Some(problems)
}

fn model(name: &str) -> fn(&[f64], &[f64]) -> f64 {
    match name {
        "Bennett5" => |b, x| b[0] * (b[1] + x[0]).powf(-1.0 / b[2]),
        "BoxBOD" | "Misra1a" => |b, x| b[0] * (1.0 - (-b[1] * x[0]).exp()),
        "Chwirut1" | "Chwirut2" => |b, x| (-b[0] * x[0]).exp() / (b[1] + b[2] * x[0]),
        "DanWood" => |b, x| b[0] * x[0].powf(b[1]),
        "ENSO" => |b, x| {
            let turn = |period: f64| 2.0 * PI * x[0] / period;
            b[0] + b[1] * turn(12.0).cos()
                + b[2] * turn(12.0).sin()
                + b[4] * turn(b[3]).cos()
                + b[5] * turn(b[3]).sin()
                + b[7] * turn(b[6]).cos()
                + b[8] * turn(b[6]).sin()
        },
        "Eckerle4" => |b, x| b[0] / b[1] * (-0.5 * ((x[0] - b[2]) / b[1]).powi(2)).exp(),
        "Gauss1" | "Gauss2" | "Gauss3" => |b, x| {
            b[0] * (-b[1] * x[0]).exp()
                + b[2] * (-((x[0] - b[3]) / b[4]).powi(2)).exp()
                + b[5] * (-((x[0] - b[6]) / b[7]).powi(2)).exp()
        },
        "Hahn1" | "Thurber" => |b, x| {
            let x = x[0];
            (b[0] + x * (b[1] + x * (b[2] + x * b[3]))) / (1.0 + x * (b[4] + x * (b[5] + x * b[6])))
        },
        "Kirby2" => |b, x| {
            let x = x[0];
            (b[0] + x * (b[1] + x * b[2])) / (1.0 + x * (b[3] + x * b[4]))
        },
        "Lanczos1" | "Lanczos2" | "Lanczos3" => {
            |b, x| b[0] * (-b[1] * x[0]).exp() + b[2] * (-b[3] * x[0]).exp() + b[4] * (-b[5] * x[0]).exp()
        }
        "MGH09" => |b, x| b[0] * (x[0] * x[0] + x[0] * b[1]) / (x[0] * x[0] + x[0] * b[2] + b[3]),
        "MGH10" => |b, x| b[0] * (b[1] / (x[0] + b[2])).exp(),
        "MGH17" => |b, x| b[0] + b[1] * (-x[0] * b[3]).exp() + b[2] * (-x[0] * b[4]).exp(),
        "Misra1b" => |b, x| b[0] * (1.0 - (1.0 + b[1] * x[0] / 2.0).powi(-2)),
        "Misra1c" => |b, x| b[0] * (1.0 - (1.0 + 2.0 * b[1] * x[0]).powf(-0.5)),
        "Misra1d" => |b, x| b[0] * b[1] * x[0] / (1.0 + b[1] * x[0]),
        "Nelson" => |b, x| b[0] - b[1] * x[0] * (-b[2] * x[1]).exp(),
        "Rat42" => |b, x| b[0] / (1.0 + (b[1] - b[2] * x[0]).exp()),
        "Rat43" => |b, x| b[0] / (1.0 + (b[1] - b[2] * x[0]).exp()).powf(1.0 / b[3]),
        "Roszman1" => |b, x| b[0] - b[1] * x[0] - (b[2] / (x[0] - b[3])).atan() / PI,
        other => panic!("no model for {other}"),
    }
}
