//! Modes from frequency responses: the reference fits, functions of known modes found again in every form of file, intervals
//! that hold, and every refusal by doing it.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, clippy::float_cmp, missing_docs)]

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use nalgebra::Complex;
use precut_calc::calculator::{Answer, Calculator, Check, Failure, Finding, Unwatched, Value as Said, Violations};
use precut_calc::num::stats::Resampler;
use precut_calc::receptance_fit::{Job, Outcome, ReceptanceFit, Unit};
use serde_json::{Value, json};

/// Natural frequency in Hz, damping ratio, mass in kg, direction.
type Mode = (f64, f64, f64, [f64; 2]);

const X: [f64; 2] = [1.0, 0.0];

fn reference(name: &str) -> Vec<u8> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("reference/milling");
    fs::read(folder.join(name)).unwrap()
}

fn text(bytes: Vec<u8>) -> Value {
    json!({"files": [{"text": String::from_utf8(bytes).unwrap()}]})
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let at = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let whole = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let digit = usize::try_from(whole >> (18 - 6 * i) & 63).unwrap();
            text.push(if i <= three.len() { char::from(DIGITS[digit]) } else { '=' });
        }
    }
    text
}

fn binary(bytes: &[u8]) -> Value {
    json!({"files": [{"base64": base64(bytes)}]})
}

fn found(job: &Value) -> Vec<Finding> {
    let job: Job = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec()
}

fn try_solve(job: &Value) -> Result<Answer<Outcome>, Failure> {
    assert_eq!(found(job), Vec::new());
    ReceptanceFit::run(&serde_json::from_value(job.clone()).unwrap(), &Unwatched)
}

fn solve(job: &Value) -> Answer<Outcome> {
    try_solve(job).unwrap()
}

fn warned(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.warnings.iter().map(|finding| finding.code).collect()
}

/// The only fault of a job.
fn refused(job: &Value) -> Finding {
    let mut found = found(job);
    assert_eq!(found.len(), 1, "{found:?}");
    found.remove(0)
}

fn close(value: f64, expected: f64, relative: f64, what: &str) {
    assert!((value / expected - 1.0).abs() < relative, "{what}: {value} against {expected}");
}

/// m/N along p over force along q.
fn receptance(modes: &[Mode], frequency_hz: f64, (p, q): (usize, usize)) -> Complex<f64> {
    let w = TAU * frequency_hz;
    let one = |(f, zeta, mass, d): &Mode| {
        let w_k = TAU * f;
        Complex::new(w_k * w_k - w * w, 2.0 * zeta * w_k * w).inv() * (d[p] * d[q] / mass)
    };
    modes.iter().map(one).sum()
}

fn frequencies(from_hz: f64, step_hz: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| from_hz + step_hz * i as f64).collect()
}

/// The quantity of a unit, in SI, with noise as a share of its root mean square.
fn measured(
    receptances: &[Complex<f64>],
    frequency_hz: &[f64],
    unit: Unit,
    (share, draw): (f64, &mut Resampler),
) -> Vec<Complex<f64>> {
    let factor = |f: &f64| Complex::new(0.0, TAU * f).powi(unit.derivative());
    let exact: Vec<Complex<f64>> = receptances.iter().zip(frequency_hz).map(|(h, f)| h * factor(f)).collect();
    let rms = (exact.iter().map(Complex::norm_sqr).sum::<f64>() / exact.len() as f64).sqrt();
    let mut noise = || Complex::new(draw.normal(), draw.normal()) * (share * rms / 2.0_f64.sqrt());
    exact.iter().map(|value| value + noise()).collect()
}

fn csv(frequency_hz: &[f64], values: &[Complex<f64>], unit: Unit) -> String {
    let mut text = format!("frequency [Hz],real [{0}],imaginary [{0}]\n", unit.spelling());
    for (f, value) in frequency_hz.iter().zip(values) {
        let value = value / unit.si();
        writeln!(text, "{f},{:e},{:e}", value.re, value.im).unwrap();
    }
    text
}

/// How a set of a universal file is written.
#[derive(Clone, Copy)]
#[allow(clippy::struct_excessive_bools)] // each is a choice of its own
struct Form {
    binary: bool,
    big: bool,
    double: bool,
    even: bool,
    /// Frequencies of double values as 4 bytes.
    mixed: bool,
}

/// A set of dataset 58 or 58b: function type, kind above the line, directions, lines.
fn set(
    form: Form,
    (kind, above): (usize, usize),
    (response, excitation): (i32, i32),
    frequency_hz: &[f64],
    values: &[Complex<f64>],
) -> Vec<u8> {
    let is_complex = kind == 4;
    let mut data = Vec::new();
    let mut lines = String::new();
    let mut on_line = 0;
    let per_line = if form.double && !form.even && is_complex {
        3
    } else if form.double {
        4
    } else {
        6
    };
    let mut put = |value: f64, short: bool| {
        if !form.binary {
            let width = if form.double && !short { 20 } else { 13 };
            let digits = if form.double && !short { 12 } else { 5 };
            write!(lines, "{:>width$}", fortran(value, digits)).unwrap();
            on_line += 1;
            if on_line == per_line {
                lines.push('\n');
                on_line = 0;
            }
        } else if form.double && !(short && form.mixed) {
            data.extend(if form.big { value.to_be_bytes() } else { value.to_le_bytes() });
        } else {
            #[allow(clippy::cast_possible_truncation)] // single precision is what is asked for
            let single = value as f32;
            data.extend(if form.big { single.to_be_bytes() } else { single.to_le_bytes() });
        }
    };
    for (f, value) in frequency_hz.iter().zip(values) {
        if !form.even {
            put(*f, true);
        }
        put(value.re, false);
        if is_complex {
            put(value.im, false);
        }
    }
    if on_line > 0 {
        lines.push('\n');
    }
    let mut head = String::from("    -1\n");
    if form.binary {
        let order = if form.big { 2 } else { 1 };
        writeln!(head, "{:6}b{order:6}{:6}{:12}{:12}{:6}{:6}{:12}{:12}", 58, 2, 11, data.len(), 0, 0, 0, 0).unwrap();
    } else {
        head.push_str("    58\n");
    }
    head.push_str("tap test\nNONE\nNONE\nNONE\nNONE\n");
    writeln!(
        head,
        "{kind:5}{:10}{:5}{:10} {:10}{:10}{response:4} {:10}{:10}{excitation:4}",
        0, 0, 0, "tip", 1, "tip", 1
    )
    .unwrap();
    let data_type = match (is_complex, form.double) {
        (false, false) => 2,
        (false, true) => 4,
        (true, false) => 5,
        (true, true) => 6,
    };
    let (spacing, first, step) =
        if form.even { (1, frequency_hz[0], frequency_hz[1] - frequency_hz[0]) } else { (0, 0.0, 0.0) };
    writeln!(
        head,
        "{data_type:10}{:10}{spacing:10}{:>13}{:>13}{:>13}",
        values.len(),
        fortran(first, 5),
        fortran(step, 5),
        fortran(0.0, 5)
    )
    .unwrap();
    for kind in [18, above, 13, 0] {
        writeln!(head, "{kind:10}{:5}{:5}{:5} {:20} {:20}", 0, 0, 0, "NONE", "NONE").unwrap();
    }
    let mut bytes = head.into_bytes();
    if form.binary {
        bytes.extend(data);
        bytes.push(b'\n');
    } else {
        bytes.extend(lines.into_bytes());
    }
    bytes.extend(b"    -1\n");
    bytes
}

/// A number as Fortran writes it: the exponent signed, of two digits.
fn fortran(value: f64, digits: usize) -> String {
    let plain = format!("{value:.digits$e}");
    let (mantissa, exponent) = plain.split_once('e').unwrap();
    let exponent: i32 = exponent.parse().unwrap();
    format!("{mantissa}E{}{:02}", if exponent < 0 { '-' } else { '+' }, exponent.abs())
}

const TEXT: Form = Form { binary: false, big: false, double: true, even: true, mixed: false };

fn two_modes() -> Vec<Mode> {
    vec![(520.0, 0.031, 0.92, X), (1180.0, 0.022, 0.34, X)]
}

#[test]
fn fits_are_those_of_the_reference() {
    for (case, files) in
        [("frf-P01", &["frf-P01.csv", "frf-P01-ascii.uff", "frf-P01-binary.uff"][..]), ("frf-P02", &["frf-P02.csv"])]
    {
        let read: Value = serde_json::from_slice(&reference(&format!("{case}.json"))).unwrap();
        let expected = &read["cases"][0]["expected"];
        let number = |of: &Value, k: usize| of[k].as_f64().unwrap();
        for file in files {
            let bytes = reference(file);
            let answer = solve(&if file.contains("binary") { binary(&bytes) } else { text(bytes) });
            let outcome = &answer.output;
            assert_eq!(outcome.modes.len(), expected["mass_kg"].as_array().unwrap().len(), "{file}");
            for (k, (mode, known)) in outcome.modes.iter().zip(&outcome.certainty).enumerate() {
                close(mode.frequency_hz, number(&expected["frequency_hz"], k), 1e-6, file);
                close(mode.damping_ratio, number(&expected["damping_ratio"], k), 1e-6, file);
                close(mode.mass_kg, number(&expected["mass_kg"], k), 1e-6, file);
                let errors = &expected["relative_standard_error"];
                close(known.frequency_error_hz / mode.frequency_hz, number(&errors["frequency"], k), 1e-4, file);
                close(known.damping_ratio_error / mode.damping_ratio, number(&errors["damping"], k), 1e-4, file);
                close(known.mass_error_kg / mode.mass_kg, number(&errors["mass"], k), 1e-4, file);
            }
            let function = &outcome.functions[0];
            close(function.residual_share, expected["residual_rms_rel"].as_f64().unwrap(), 1e-6, file);
            assert!(outcome.groups[0].bic_one_less.unwrap() > outcome.groups[0].bic, "{file}");
            assert!(outcome.groups[0].bic_one_more.unwrap() > outcome.groups[0].bic, "{file}");
            assert_eq!(warned(&answer), Vec::<&str>::new(), "{file}");
        }
    }
}

#[test]
fn a_universal_file_gives_what_its_csv_gives_to_the_last_digit() {
    let from_csv = solve(&text(reference("frf-P01.csv"))).output;
    assert_eq!(solve(&text(reference("frf-P01-ascii.uff"))).output, from_csv);
    assert_eq!(solve(&binary(&reference("frf-P01-binary.uff"))).output, from_csv);
}

#[test]
fn every_form_of_a_set_gives_the_same_numbers() {
    let mut draw = Resampler::new(11, 0);
    let even = frequencies(200.0, 8.0, 150);
    let receptances: Vec<Complex<f64>> = even.iter().map(|f| receptance(&two_modes(), *f, (0, 0))).collect();
    // Numbers that single precision and six digits hold exactly.
    let coarse = |x: f64| (x * 1000.0).round() / 1024.0;
    let values: Vec<Complex<f64>> = measured(&receptances, &even, Unit::MPerS2PerN, (0.01, &mut draw))
        .into_iter()
        .map(|value| Complex::new(coarse(value.re), coarse(value.im)))
        .collect();
    let wanted = solve(&json!({"files": [{"text": csv(&even, &values, Unit::MPerS2PerN)}]})).output;
    let all = [false, true];
    let mut forms = vec![TEXT, Form { even: false, ..TEXT }];
    for (big, even) in all.into_iter().flat_map(|big| all.map(|even| (big, even))) {
        forms.extend(all.map(|double| Form { binary: true, big, double, even, mixed: false }));
        forms.push(Form { binary: true, big, double: true, even, mixed: !even });
    }
    for form in forms {
        let bytes = set(form, (4, 12), (1, 1), &even, &values);
        let job = if form.binary { binary(&bytes) } else { text(bytes) };
        assert_eq!(solve(&job).output, wanted);
    }
}

#[test]
fn units_quantities_and_polar_form_say_the_same() {
    let hz = frequencies(200.0, 8.0, 150);
    let receptances: Vec<Complex<f64>> = hz.iter().map(|f| receptance(&two_modes(), *f, (0, 0))).collect();
    for unit in [
        Unit::MPerN,
        Unit::MmPerN,
        Unit::UmPerN,
        Unit::MPerSPerN,
        Unit::MmPerSPerN,
        Unit::MPerS2PerN,
        Unit::MmPerS2PerN,
        Unit::GPerN,
    ] {
        let values = measured(&receptances, &hz, unit, (1e-6, &mut Resampler::new(5, 0)));
        let mut polar = format!("f [kHz];amplitude [{}];phase [rad];coherence\n", unit.spelling());
        for (f, value) in hz.iter().zip(&values) {
            let line = format!("{};{:e};{:e};0.9\n", f / 1000.0, value.norm() / unit.si(), value.arg());
            polar.push_str(&line.replace('.', ","));
        }
        let mut bare = csv(&hz, &values, unit);
        bare = bare.replacen(&format!("real [{}]", unit.spelling()), "real", 1);
        bare = bare.replacen(&format!("imaginary [{}]", unit.spelling()), "imaginary", 1);
        let stated = serde_json::to_value(unit).unwrap();
        for file in
            [json!({"text": csv(&hz, &values, unit)}), json!({"text": polar}), json!({"text": bare, "unit": stated})]
        {
            let outcome = solve(&json!({"files": [file]})).output;
            for (mode, (f, zeta, mass, _)) in outcome.modes.iter().zip(two_modes()) {
                close(mode.frequency_hz, f, 1e-6, "frequency");
                close(mode.damping_ratio, zeta, 1e-5, "damping");
                close(mode.mass_kg, mass, 1e-5, "mass");
                assert_eq!(mode.direction, [1.0, 0.0, 0.0]);
            }
        }
    }
}

/// A job of one function of drawn modes with noise of 1 %.
fn drawn(seed: u64) -> (Vec<Mode>, Value) {
    let mut draw = Resampler::new(seed, 0);
    let count = 1 + draw.below(4);
    let mut modes: Vec<Mode> = Vec::new();
    while modes.len() < count {
        let f = 200.0 * 12.5_f64.powf(draw.uniform());
        if modes.iter().all(|other| (other.0 / f).ln().abs() > 0.1) {
            modes.push((f, 0.01 * 5.0_f64.powf(draw.uniform()), 0.3 * 10.0_f64.powf(draw.uniform()), X));
        }
    }
    modes.sort_by(|a, b| a.0.total_cmp(&b.0));
    let hz = frequencies(100.0, 5.0, 581);
    let beside = |f: &f64| Complex::new(1e-9 - 0.05 / (TAU * f).powi(2), 0.0);
    let receptances: Vec<Complex<f64>> = hz.iter().map(|f| receptance(&modes, *f, (0, 0)) + beside(f)).collect();
    let unit = [Unit::UmPerN, Unit::MPerSPerN, Unit::MPerS2PerN][draw.below(3)];
    let values = measured(&receptances, &hz, unit, (0.01, &mut draw));
    (modes, json!({"files": [{"text": csv(&hz, &values, unit)}]}))
}

/// The 95 % intervals of as many draws as `PRECUT_RECEPTANCE_DRAWS` says hold the truth in 92 to 97 %.
#[test]
fn intervals_hold_what_they_say() {
    let draws: u64 = std::env::var("PRECUT_RECEPTANCE_DRAWS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    let (mut held, mut total, mut missed) = ([0.0; 3], 0.0, 0);
    for seed in 0..draws {
        let (modes, job) = drawn(seed);
        let outcome = solve(&job).output;
        if outcome.modes.len() != modes.len() {
            missed += 1;
            continue;
        }
        for ((mode, known), truth) in outcome.modes.iter().zip(&outcome.certainty).zip(&modes) {
            total += 1.0;
            let off = [
                (mode.frequency_hz - truth.0) / known.frequency_error_hz,
                (mode.damping_ratio - truth.1) / known.damping_ratio_error,
                (mode.mass_kg - truth.2) / known.mass_error_kg,
            ];
            for (held, off) in held.iter_mut().zip(off) {
                *held += if off.abs() < 1.96 { 1.0 } else { 0.0 };
            }
        }
    }
    // One in a hundred draws hides a mode in another's flank.
    assert!(f64::from(missed) <= 0.02 * draws as f64, "{missed} of {draws}");
    let share = held.iter().sum::<f64>() / (3.0 * total);
    assert!((0.92..=0.97).contains(&share), "{share}: {held:?} of {total}, {missed} of {draws} missed");
}

#[test]
fn oblique_modes_are_found_from_linked_directions_and_each_direction_by_itself_without_a_link() {
    let tilted = |deg: f64| [deg.to_radians().cos(), deg.to_radians().sin()];
    let modes: Vec<Mode> = vec![(430.0, 0.03, 1.4, tilted(35.0)), (610.0, 0.025, 0.9, tilted(-50.0))];
    let hz = frequencies(200.0, 4.0, 200);
    let mut draw = Resampler::new(2, 0);
    let axis = ["x", "y"];
    let mut file = |(p, q): (usize, usize), against: bool| {
        let receptances: Vec<Complex<f64>> = hz.iter().map(|f| receptance(&modes, *f, (p, q))).collect();
        let sign = if against { -1.0 } else { 1.0 };
        let values: Vec<Complex<f64>> = measured(&receptances, &hz, Unit::MPerS2PerN, (0.005, &mut draw))
            .into_iter()
            .map(|value| value * sign)
            .collect();
        let response = if against { format!("minus_{}", axis[p]) } else { axis[p].to_owned() };
        json!({"text": csv(&hz, &values, Unit::MPerS2PerN), "response": response, "excitation": axis[q]})
    };
    let linked = json!({"files": [file((0, 0), false), file((1, 0), true), file((1, 1), false)]});
    let answer = solve(&linked);
    assert_eq!(answer.output.modes.len(), 2);
    assert_eq!(answer.output.groups.len(), 1);
    for ((mode, known), (f, zeta, mass, d)) in answer.output.modes.iter().zip(&answer.output.certainty).zip(&modes) {
        assert!((mode.frequency_hz - f).abs() < 4.0 * known.frequency_error_hz, "{mode:?}");
        assert!((mode.damping_ratio - zeta).abs() < 4.0 * known.damping_ratio_error, "{mode:?}");
        assert!((mode.mass_kg - mass).abs() < 4.0 * known.mass_error_kg, "{mode:?}");
        let along = mode.direction[0] * d[0] + mode.direction[1] * d[1];
        assert!(along.abs() > 1.0 - 1e-4, "{mode:?}");
    }
    assert!(answer.explanation.iter().all(|message| message.code != "direction_counts_as_rigid"));
    let apart = solve(&json!({"files": [linked["files"][0], linked["files"][2]]}));
    assert_eq!(apart.output.groups.len(), 2);
    assert!(apart.output.modes.iter().all(|mode| mode.direction.contains(&1.0)));
    let along_x = solve(&json!({"files": [linked["files"][0]]}));
    let rigid = along_x.explanation.iter().find(|message| message.code == "direction_counts_as_rigid").unwrap();
    assert_eq!(rigid.values.get("direction"), Some(&Said::from("y")));
    let cross = refused(&json!({"files": [linked["files"][1]]}));
    assert_eq!((cross.code, cross.pointer.as_str()), ("no_direct_function", "/files/0"));
}

#[test]
fn modes_are_what_a_job_of_milling_takes() {
    let outcome = solve(&text(reference("frf-P01.csv"))).output;
    let modes = serde_json::to_value(&outcome.modes).unwrap();
    let names: Vec<&String> = modes[0].as_object().unwrap().keys().collect();
    assert_eq!(names, ["direction", "frequency_hz", "damping_ratio", "mass_kg"]);
    let stiffness = outcome.modes[0].mass_kg * (TAU * outcome.modes[0].frequency_hz).powi(2) / 1000.0;
    close(outcome.certainty[0].stiffness_n_per_mm, stiffness, 1e-12, "stiffness");
}

#[test]
fn lines_of_low_coherence_weigh_little() {
    let hz = frequencies(200.0, 4.0, 300);
    let modes = two_modes();
    let (mut weighed, mut plain) = (0.0, 0.0);
    for seed in 0..6 {
        let mut draw = Resampler::new(seed, 3);
        let mut rows = String::from("frequency [Hz],real [um/N],imaginary [um/N],coherence\n");
        for f in &hz {
            let h = receptance(&modes, *f, (0, 0)) * 1e6;
            // A stretch beside the first mode is bad.
            let share = if (560.0..900.0).contains(f) { 0.5 } else { 0.01 };
            let noisy = h + Complex::new(draw.normal(), draw.normal()) * (share * h.norm());
            writeln!(rows, "{f},{:e},{:e},{:e}", noisy.re, noisy.im, 1.0 / (1.0 + 2.0 * share * share)).unwrap();
        }
        let bare = rows.replacen(",coherence", ",quality", 1);
        let off =
            |text: &str| solve(&json!({"files": [{"text": text}], "modes": 2})).output.modes[0].mass_kg / 0.92 - 1.0;
        weighed += off(&rows).powi(2);
        plain += off(&bare).powi(2);
    }
    assert!(weighed < 0.25 * plain, "{weighed} against {plain}");
}

#[test]
fn coherence_of_a_universal_file_goes_to_its_function() {
    let hz = frequencies(200.0, 8.0, 100);
    let values: Vec<Complex<f64>> =
        hz.iter().map(|f| receptance(&two_modes(), *f, (0, 0)) * -(TAU * f).powi(2)).collect();
    let coherence: Vec<Complex<f64>> =
        (0..hz.len()).map(|i| Complex::new(if i < 30 { 0.5 } else { 0.99 }, 0.0)).collect();
    let mut bytes = set(TEXT, (4, 12), (1, 1), &hz, &values);
    bytes.extend(set(TEXT, (6, 12), (1, 1), &hz, &coherence));
    let mut rows = String::from("frequency [Hz],real [m/s2/N],imaginary [m/s2/N],coherence\n");
    for ((f, value), coherence) in hz.iter().zip(&values).zip(&coherence) {
        let [re, im] = [value.re, value.im].map(|x| fortran(x, 12));
        writeln!(rows, "{f},{re},{im},{}", coherence.re).unwrap();
    }
    assert_eq!(solve(&text(bytes)).output, solve(&json!({"files": [{"text": rows}]})).output);
}

/// A mode whose residue is turned by an angle.
fn turned(frequency_hz: f64, deg: f64) -> Complex<f64> {
    let (w_k, zeta, mass) = (TAU * 520.0, 0.03, 0.9);
    let w_d = w_k * (1.0_f64 - zeta * zeta).sqrt();
    let residue = Complex::from_polar(1.0 / (2.0 * w_d * mass), -0.5 * PI + deg.to_radians());
    let (pole, s) = (Complex::new(-zeta * w_k, w_d), Complex::new(0.0, TAU * frequency_hz));
    residue / (s - pole) + residue.conj() / (s - pole.conj())
}

#[test]
fn residues_that_are_not_those_of_real_modes_are_told() {
    let hz = frequencies(300.0, 2.0, 250);
    for (deg, warns) in [(0.0, false), (9.0, false), (11.5, true), (-30.0, true)] {
        let receptances: Vec<Complex<f64>> = hz.iter().map(|f| turned(*f, deg)).collect();
        let values = measured(&receptances, &hz, Unit::UmPerN, (0.002, &mut Resampler::new(9, 0)));
        let answer = solve(&json!({"files": [{"text": csv(&hz, &values, Unit::UmPerN)}], "modes": 1}));
        assert_eq!(warned(&answer).contains(&"modes_not_proportional"), warns, "{deg}: {:?}", answer.output.certainty);
        assert!(
            (answer.output.certainty[0].residue_phase_deg - f64::abs(deg)).abs() < 1.5,
            "{deg}: {:?}",
            answer.output.certainty
        );
    }
}

#[test]
fn a_number_of_modes_that_does_not_fit_is_told_and_what_is_advised_helps() {
    let job = |modes: Option<u32>| {
        let mut job = text(reference("frf-P02.csv"));
        if let Some(modes) = modes {
            job["modes"] = modes.into();
        }
        job
    };
    let few = solve(&job(Some(2)));
    assert!(warned(&few).contains(&"other_number_fits_better") && warned(&few).contains(&"remainder_has_pattern"));
    let told = few.warnings.iter().find(|finding| finding.code == "other_number_fits_better").unwrap();
    assert_eq!(told.values.get("better"), Some(&Said::Number(3.0)));
    assert_eq!(warned(&solve(&job(Some(3)))), Vec::<&str>::new());
    assert_eq!(solve(&job(Some(3))).output, solve(&job(None)).output);
    assert!(warned(&solve(&job(Some(4)))).contains(&"other_number_fits_better"));
    let narrow = json!({"files": job(None)["files"], "from_hz": 900.0, "to_hz": 1500.0});
    let outcome = solve(&narrow).output;
    assert_eq!(outcome.modes.len(), 1);
    assert!(outcome.curve.iter().all(|row| (900.0..=1500.0).contains(&row.frequency_hz)));
}

#[test]
fn numbers_that_no_machine_has_are_told_on_both_sides_of_their_limit() {
    let hz = frequencies(200.0, 4.0, 200);
    for (mass, warns) in [(2e-3, false), (0.5e-3, true), (9e3, false), (2e4, true)] {
        let modes = [(520.0, 0.03, mass, X)];
        let receptances: Vec<Complex<f64>> = hz.iter().map(|f| receptance(&modes, *f, (0, 0))).collect();
        let values = measured(&receptances, &hz, Unit::MPerN, (0.001, &mut Resampler::new(1, 0)));
        let answer = solve(&json!({"files": [{"text": csv(&hz, &values, Unit::MPerN)}]}));
        assert_eq!(warned(&answer).contains(&"mode_implausible"), warns, "{mass}");
    }
}

#[test]
fn noise_alone_has_no_mode_to_tell() {
    let hz = frequencies(200.0, 4.0, 40);
    let mut draw = Resampler::new(4, 0);
    let values: Vec<Complex<f64>> = hz.iter().map(|_| Complex::new(draw.normal(), draw.normal()) * 1e-6).collect();
    match try_solve(&json!({"files": [{"text": csv(&hz, &values, Unit::UmPerN)}]})) {
        Err(Failure::OutOfModel(finding)) => assert_eq!(finding.code, "no_mode_seen"),
        other => panic!("{other:?}"),
    }
}

fn said(finding: &Finding, name: &str) -> String {
    match finding.values.get(name) {
        Some(Said::Number(number)) => number.to_string(),
        Some(Said::Text(text)) => text.to_string(),
        other => panic!("{name}: {other:?}"),
    }
}

const HEADER: &str = "frequency [Hz],real [um/N],imaginary [um/N]";

#[test]
fn faults_of_csv_name_line_column_and_what_was_found() {
    let rows = |header: &str, change: &dyn Fn(usize) -> Option<String>, count: usize| {
        let lines = (0..count).map(|i| change(i).unwrap_or_else(|| format!("{},1,2", 100 + i)));
        let text = [header.to_owned()].into_iter().chain(lines).collect::<Vec<_>>().join("\n");
        json!({"files": [{"text": text}]})
    };
    let same = |_: usize| None;
    let at = |line: usize, text: &'static str| move |i: usize| (i + 2 == line).then(|| text.to_owned());
    for (job, code, places) in [
        (rows("frequency [Hz],real,imaginary", &same, 20), "unit_missing", vec![("line", "1"), ("column", "real")]),
        (rows("frequency,real [um/N],imaginary [um/N]", &same, 20), "unit_missing", vec![("column", "frequency")]),
        (rows("frequency [Hz],amplitude [um/N],phase", &same, 20), "unit_missing", vec![("column", "phase")]),
        (rows("frequency [Hz],real [V],imaginary [V]", &same, 20), "unit_unknown", vec![("found", "V")]),
        (rows("frequency [Hz],real [um/N],imaginary [mm/N]", &same, 20), "unit_unknown", vec![("found", "mm/N")]),
        (rows("frequency [Hz],amplitude [dB],phase [deg]", &same, 20), "decibel", vec![("found", "dB"), ("line", "1")]),
        (rows("time [s],force [N]", &same, 20), "not_frf", vec![("line", "1"), ("found", "time [s],force [N]")]),
        (rows(HEADER, &at(7, "103,1,2"), 20), "frequency_order", vec![("line", "7"), ("number", "6")]),
        (rows(HEADER, &at(9, "107,x,2"), 20), "cell_not_a_number", vec![("line", "9"), ("found", "x")]),
        (rows(HEADER, &at(9, "107,1"), 20), "cell_not_a_number", vec![("column", "imaginary [um/N]")]),
        (rows(HEADER, &same, 15), "too_few_lines", vec![("lines", "15"), ("minimum", "16")]),
        (rows(HEADER, &|i| Some(format!("{},0,0", i + 1)), 20), "nothing_measured", vec![("set", "1")]),
        (
            rows("frequency [Hz],real [um/N],imaginary [um/N],coherence", &|i| Some(format!("{},1,2,1.5", i + 1)), 20),
            "coherence_out_of_range",
            vec![("line", "2")],
        ),
    ] {
        let finding = refused(&job);
        assert_eq!((finding.code, finding.pointer.as_str()), (code, "/files/0/text"));
        for (name, expected) in places {
            assert_eq!(said(&finding, name), expected, "{code}");
        }
    }
    // A line at 0 Hz is left out; the rest has to suffice.
    assert_eq!(found(&rows(HEADER, &|i| Some(format!("{i},1,2")), 17)), Vec::new());
    let mut band = rows(HEADER, &same, 40);
    band["from_hz"] = 130.0.into();
    assert_eq!(refused(&band).code, "too_few_lines");
    band["to_hz"] = 120.0.into();
    assert_eq!(refused(&band).code, "empty_band");
    let long = rows(HEADER, &same, 50_001);
    assert_eq!(refused(&long).code, "too_many_frf_lines");
    assert_eq!(refused(&json!({"files": [{}]})).code, "file_missing");
    assert_eq!(refused(&json!({"files": [{"text": "a", "base64": "YQ=="}]})).code, "file_twice");
    let wrong = refused(&json!({"files": [{"base64": "QUJD?"}]}));
    assert_eq!((wrong.code, said(&wrong, "place")), ("not_base64", "5".to_owned()));
}

#[test]
fn faults_of_universal_files_name_set_and_byte() {
    let hz = frequencies(100.0, 5.0, 40);
    let values: Vec<Complex<f64>> = hz.iter().map(|f| Complex::new(1.0, *f)).collect();
    let form = Form { binary: true, double: false, ..TEXT };
    let whole = set(form, (4, 12), (1, 1), &hz, &values);
    let mut second = whole.clone();
    second.extend(&whole[..whole.len() - 40]);
    let cut = refused(&binary(&second));
    assert_eq!((cut.code, said(&cut, "set")), ("uff_truncated", "2".to_owned()));
    assert_eq!(said(&cut, "byte"), second.len().to_string());
    let ascii = String::from_utf8(set(TEXT, (4, 12), (1, 1), &hz, &values)).unwrap();
    let lines: Vec<&str> = ascii.lines().collect();
    let short = lines[..lines.len() - 4].join("\n");
    assert_eq!(refused(&text(short.into_bytes())).code, "uff_truncated");
    let unended = lines[..lines.len() - 1].join("\n");
    assert_eq!(refused(&text(unended.into_bytes())).code, "uff_truncated");
    let changed = |from: &str, to: &str| {
        assert!(ascii.contains(from), "{from}");
        text(ascii.replacen(from, to, 1).into_bytes())
    };
    let miscounted = {
        let text = String::from_utf8_lossy(&whole[..200]).into_owned();
        let at = text.find("         320").unwrap();
        let mut bytes = whole.clone();
        bytes[at..at + 12].copy_from_slice(b"         312");
        bytes
    };
    let counted = refused(&binary(&miscounted));
    assert_eq!((counted.code, said(&counted, "expected")), ("uff_truncated", "320".to_owned()));
    let none = refused(&text(set(TEXT, (1, 12), (1, 1), &hz, &values)));
    assert_eq!(none.code, "uff_no_frf");
    let real = refused(&changed("         6        40", "         4        80"));
    assert_eq!((real.code, said(&real, "line")), ("not_frf", "9".to_owned()));
    for (from, to, code) in [
        ("         6        40", "         9        40", "uff_format"),
        ("        18    0", "        17    0", "not_frf"),
        ("        12    0", "         9    0", "not_frf"),
        ("        13    0", "        12    0", "not_frf"),
        (
            "        12    0    0    0 NONE                 NONE",
            "        12    0    0    0 NONE                 dB  ",
            "decibel",
        ),
        (
            "        12    0    0    0 NONE                 NONE",
            "        12    0    0    0 NONE                 V   ",
            "unit_unknown",
        ),
        (
            "        12    0    0    0 NONE                 NONE",
            "        12    0    0    0 NONE                 mm  ",
            "unit_unknown",
        ),
        (
            "        12    0    0    0 NONE                 NONE",
            "         0    0    0    0 NONE                 NONE",
            "unit_missing",
        ),
        ("   1 tip", "   4 tip", "not_frf"),
        ("E+00", "E?00", "cell_not_a_number"),
    ] {
        let finding = refused(&changed(from, to));
        assert_eq!(finding.code, code, "{to}");
        assert_eq!(said(&finding, "set"), "1");
    }
    // The unit of a label counts, and what a file does not say the job may.
    for (from, to, unit) in [
        ("12    0    0    0 NONE                 NONE    ", "12    0    0    0 NONE                 mm/s^2  ", None),
        (
            "        12    0    0    0 NONE                 NONE",
            "         0    0    0    0 NONE                 NONE",
            Some("mm_per_s2_per_n"),
        ),
    ] {
        let mut job = changed(from, to);
        if let Some(unit) = unit {
            job["files"][0]["unit"] = unit.into();
        }
        let job: Job = serde_json::from_value(job).unwrap();
        let functions = precut_calc::receptance_fit::read(&job.files, "/files").unwrap();
        assert_eq!(functions[0].unit, Unit::MmPerS2PerN);
        assert!((functions[0].values[0].re - 1e-3).abs() < 1e-12);
    }
}
