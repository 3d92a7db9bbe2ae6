//! The conditions of a cut, as a run states them, a point of it, and a measured row.

/// A struct whose fields are the conditions of a cut, between those of its own. `$wear` says what the flank wear is.
macro_rules! with_conditions {
    ($(#[$meta:meta])* $name:ident, wear: $wear:tt, { $($before:tt)* } conditions { $($after:tt)* }) => {
        $(#[$meta])*
        pub struct $name {
            $($before)*
            /// Cutting speed.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 1e-2, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
            pub speed_m_per_min: Option<f64>,
            /// Feed.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S"))))]
            pub feed_mm_per_rev: Option<f64>,
            /// Depth of cut.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t"))))]
            pub depth_mm: Option<f64>,
            /// Major cutting edge angle.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 1.0, maximum = 179.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
            pub cutting_edge_angle_deg: Option<f64>,
            /// Nose radius of the insert.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 0.01, maximum = 100.0, example = 0.8, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r"))))]
            pub nose_radius_mm: Option<f64>,
            #[doc = $wear]
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 0.0, maximum = 10.0, example = 0.2, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("VB"))))]
            pub flank_wear_mm: Option<f64>,
            /// Batch of the material.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(max_length = 64, example = "B")]
            pub batch: Option<String>,
            /// Levels of named factors.
            #[serde(default, skip_serializing_if = "Vec::is_empty")]
            #[schema(max_items = 20)]
            pub factors: Vec<FactorLevel>,
            /// Place in the order of the tests.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 0.0, maximum = 1e9, example = 7.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("test"))))]
            pub test: Option<f64>,
            /// Time that the edge had been in the cut.
            #[serde(default, skip_serializing_if = "Option::is_none")]
            #[schema(minimum = 0.0, maximum = 1e6, example = 5.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T"))))]
            pub time_min: Option<f64>,
            $($after)*
        }
    };
}

pub(in crate::feed_schedule) use with_conditions;
