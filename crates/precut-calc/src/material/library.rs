//! The materials.

use super::{Certainty, KienzleRow, Material, Sourced};
use crate::force::handbook::{self, HandbookRow, WorkMaterial};

use Certainty::{Confirmed, Likely, TextbookUnverified};

const TYPICAL: &str = "typical handbook value";
const DEFINITION: &str =
    "reference condition of the handbook's row (Spravochnik tekhnologa-mashinostroitelya, vol. 2, 1985, table 22)";
const ROHM: &str = "fit to k_c over feed at 45 degrees, Roehm norm RN 1391, table 2 (largest deviation 1.5 %); row assigned by agreement with Tschaetsch and Kienzle-Victor";
const TEXTBOOK: &str = "textbook figure (as tabulated after Kienzle and Victor)";

/// All materials, in the order of a list: steels, cast steels, irons, others.
pub fn library() -> &'static [Material] {
    &LIBRARY
}

const fn typical(value: f64) -> Sourced {
    Sourced { value, source: TYPICAL, certainty: TextbookUnverified }
}

const fn standard(value: f64, source: &'static str) -> Sourced {
    Sourced { value, source, certainty: TextbookUnverified }
}

const fn definition(value: f64) -> Sourced {
    Sourced { value, source: DEFINITION, certainty: Confirmed }
}

const fn rohm(specific_cutting_force_n_per_mm2: f64, cutting_exponent: f64) -> KienzleRow {
    KienzleRow { specific_cutting_force_n_per_mm2, cutting_exponent, source: ROHM, certainty: Likely }
}

const fn textbook(specific_cutting_force_n_per_mm2: f64, cutting_exponent: f64) -> KienzleRow {
    KienzleRow { specific_cutting_force_n_per_mm2, cutting_exponent, source: TEXTBOOK, certainty: TextbookUnverified }
}

/// A material of which only the elastic constants are known.
const fn elastic(id: &'static str, title: &'static str, modulus: f64, poisson: f64, density: f64) -> Material {
    Material {
        id,
        title,
        youngs_modulus_n_per_mm2: typical(modulus),
        poisson_ratio: typical(poisson),
        density_kg_per_m3: typical(density),
        yield_strength_n_per_mm2: None,
        tensile_strength_n_per_mm2: None,
        brinell_hardness: None,
        work_material: None,
        power_laws: &[],
        kienzle: None,
    }
}

/// A material of one of the handbook's classes.
const fn of_class(base: &Material, class: WorkMaterial, power_laws: &'static [HandbookRow]) -> Material {
    Material { work_material: Some(class), power_laws, ..*base }
}

/// A constructional steel.
const fn steel(id: &'static str, title: &'static str) -> Material {
    of_class(&elastic(id, title, 210_000.0, 0.3, 7850.0), WorkMaterial::Steel, &handbook::STEEL)
}

static LIBRARY: [Material; 24] = [
    Material {
        tensile_strength_n_per_mm2: Some(definition(750.0)),
        ..steel("steel_750", "Constructional steel of 750 N/mm2, the handbook's reference")
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(355.0, "GOST 1050, normalised, least value")),
        tensile_strength_n_per_mm2: Some(standard(600.0, "GOST 1050, normalised, least value")),
        kienzle: Some(rohm(2085.0, 0.173)),
        ..steel("steel_45", "Steel 45 (C45), normalised")
    },
    Material { kienzle: Some(rohm(2085.0, 0.173)), ..steel("c60", "Steel C60") },
    Material {
        tensile_strength_n_per_mm2: Some(standard(420.0, "DIN 17100, least value (42 kgf/mm2 by its name)")),
        kienzle: Some(rohm(1811.0, 0.162)),
        ..steel("st42", "Steel St 42")
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(295.0, "EN 10025-2, up to 16 mm, least value")),
        tensile_strength_n_per_mm2: Some(standard(470.0, "EN 10025-2, 3 to 100 mm, least value")),
        kienzle: Some(rohm(1991.0, 0.257)),
        ..steel("e295", "Steel E295 (St 50-2)")
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(335.0, "EN 10025-2, up to 16 mm, least value")),
        tensile_strength_n_per_mm2: Some(standard(570.0, "EN 10025-2, 3 to 100 mm, least value")),
        kienzle: Some(rohm(2085.0, 0.173)),
        ..steel("e335", "Steel E335 (St 60-2)")
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(360.0, "EN 10025-2, up to 16 mm, least value")),
        tensile_strength_n_per_mm2: Some(standard(670.0, "EN 10025-2, 3 to 100 mm, least value")),
        kienzle: Some(rohm(2272.0, 0.297)),
        ..steel("e360", "Steel E360 (St 70-2)")
    },
    Material { kienzle: Some(rohm(2272.0, 0.297)), ..steel("18crni8", "Case-hardening steel 18CrNi8") },
    Material { kienzle: Some(rohm(2526.0, 0.250)), ..steel("42crmo4", "Heat-treatable steel 42CrMo4") },
    Material { kienzle: Some(rohm(2109.0, 0.262)), ..steel("16mncr5", "Case-hardening steel 16MnCr5") },
    Material { kienzle: Some(rohm(2394.0, 0.201)), ..steel("mn_crni_steel", "Manganese and chromium-nickel steels") },
    Material {
        kienzle: Some(rohm(3364.0, 0.216)),
        ..elastic("austenitic_mn_steel", "Austenitic manganese steel", 190_000.0, 0.3, 7900.0)
    },
    Material {
        brinell_hardness: Some(definition(141.0)),
        ..of_class(
            &elastic("stainless_12kh18n9t", "Stainless steel 12Kh18N9T, HB 141", 198_000.0, 0.3, 7900.0),
            WorkMaterial::Stainless,
            &handbook::STAINLESS,
        )
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(190.0, "EN 10088-3, solution annealed bar, least value")),
        tensile_strength_n_per_mm2: Some(standard(500.0, "EN 10088-3, solution annealed bar, least value")),
        kienzle: Some(textbook(2350.0, 0.21)),
        ..elastic("x5crni18_10", "Stainless steel X5CrNi18-10 (1.4301)", 200_000.0, 0.3, 7900.0)
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(240.0, "by its name (EN 10293)")),
        tensile_strength_n_per_mm2: Some(standard(450.0, "by its former name GS-45 (DIN 1681), least value")),
        kienzle: Some(rohm(1610.0, 0.157)),
        ..steel("ge240", "Cast steel GE240 (GS-45)")
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(260.0, "by its former standard DIN 1681, least value")),
        tensile_strength_n_per_mm2: Some(standard(520.0, "by its former name GS-52 (DIN 1681), least value")),
        kienzle: Some(rohm(1817.0, 0.152)),
        ..steel("ge260", "Cast steel GE260 (GS-52)")
    },
    Material {
        brinell_hardness: Some(definition(190.0)),
        ..of_class(
            &elastic("grey_iron_hb190", "Grey cast iron, HB 190, the handbook's reference", 100_000.0, 0.26, 7200.0),
            WorkMaterial::GreyIron,
            &handbook::GREY_IRON,
        )
    },
    Material {
        kienzle: Some(rohm(922.0, 0.220)),
        ..of_class(
            &elastic("en_gjl_160", "Grey cast iron EN-GJL-160", 90_000.0, 0.26, 7100.0),
            WorkMaterial::GreyIron,
            &handbook::GREY_IRON,
        )
    },
    Material {
        kienzle: Some(rohm(1186.0, 0.246)),
        ..of_class(
            &elastic("en_gjl_250", "Grey cast iron EN-GJL-250", 110_000.0, 0.26, 7200.0),
            WorkMaterial::GreyIron,
            &handbook::GREY_IRON,
        )
    },
    Material {
        brinell_hardness: Some(definition(150.0)),
        ..of_class(
            &elastic(
                "malleable_iron_hb150",
                "Malleable cast iron, HB 150, the handbook's reference",
                170_000.0,
                0.26,
                7300.0,
            ),
            WorkMaterial::MalleableIron,
            &handbook::MALLEABLE_IRON,
        )
    },
    Material { kienzle: Some(textbook(780.0, 0.18)), ..elastic("brass", "Brass", 100_000.0, 0.34, 8500.0) },
    of_class(
        &elastic("silumin", "Silumin (cast aluminium-silicon alloy)", 72_000.0, 0.33, 2650.0),
        WorkMaterial::Aluminium,
        &handbook::ALUMINIUM,
    ),
    Material {
        kienzle: Some(textbook(700.0, 0.25)),
        ..elastic("aluminium_wrought", "Wrought aluminium alloy", 70_000.0, 0.33, 2700.0)
    },
    Material {
        yield_strength_n_per_mm2: Some(standard(828.0, "ASTM B348 grade 5, annealed, least value")),
        tensile_strength_n_per_mm2: Some(standard(895.0, "ASTM B348 grade 5, annealed, least value")),
        kienzle: Some(textbook(1400.0, 0.23)),
        ..elastic("ti_6al_4v", "Titanium alloy Ti-6Al-4V", 114_000.0, 0.34, 4430.0)
    },
];
