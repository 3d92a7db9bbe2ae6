use super::*;
use std::f64::consts::TAU;

fn ellipse(n: u32) -> Vec<f64> {
    let (a, b) = (150.25_f64, 149.75_f64);
    (0..n)
        .map(|i| {
            let t = TAU * f64::from(i) / f64::from(n);
            a * b / ((b * t.cos()).powi(2) + (a * t.sin()).powi(2)).sqrt()
        })
        .collect()
}

fn seed(tip_y_mm: f64, feed: f64, revolutions: f64, spark_out: f64) -> Setting {
    Setting {
        support_a_mm: [-100.0, -111.0],
        support_b_mm: [100.0, -111.0],
        roller_radius_mm: 0.0,
        tip_start_mm: [100.0, tip_y_mm],
        feed_direction: [0.0, -1.0],
        feed_mm_per_rev: feed,
        revolutions,
        spark_out_revolutions: spark_out,
        compliance_ratio: 0.0,
        wheel_radius_mm: None,
        motion: Motion::default(),
    }
}

fn run(profile: &[f64], setting: &Setting) -> Turned {
    turn::<Stuck>(profile, setting, &mut |_, _| Ok(())).unwrap()
}

#[test]
fn probe() {
    for n in [3600_u32, 7200] {
        let start = std::time::Instant::now();
        let turned = run(&ellipse(n), &seed(113.5, 1.5 / 64.0, 107.0, 0.0));
        let elapsed = start.elapsed().as_secs_f64();
        let mean = turned.radii_mm.iter().sum::<f64>() / f64::from(n);
        println!("{n} {mean} {} {:?} {:?} {} ns/step", turned.largest_bite_mm, turned.first_contact_rev, turned.last_air_cut_rev, elapsed * 1e9 / turned.steps as f64);
    }
    let start = std::time::Instant::now();
    let turned = run(&ellipse(3600), &seed(112.5, 1.5 / 256.0, 256.0, 0.0));
    let elapsed = start.elapsed().as_secs_f64();
    let mean = turned.radii_mm.iter().sum::<f64>() / 3600.0;
    println!("{mean} {} {:?} {:?} {} ns/step", turned.largest_bite_mm, turned.first_contact_rev, turned.last_air_cut_rev, elapsed * 1e9 / turned.steps as f64);
    let mut setting = seed(113.5, 0.0390625, 64.0, 1.0);
    setting.roller_radius_mm = 20.0;
    setting.support_a_mm = [-226.773378 / 2.0, -125.859225];
    setting.support_b_mm = [226.773378 / 2.0, -125.859225];
    let start = std::time::Instant::now();
    let turned = run(&ellipse(7200), &setting);
    let elapsed = start.elapsed().as_secs_f64();
    let mean = turned.radii_mm.iter().sum::<f64>() / 7200.0;
    println!("{mean} {} {:?} {:?} {} ns/step", turned.largest_bite_mm, turned.first_contact_rev, turned.last_air_cut_rev, elapsed * 1e9 / turned.steps as f64);
}
