//! How things look: a dash pattern or a marker of its own for everything that has a colour, so that nothing is said by
//! colour alone.

use std::collections::BTreeMap;

use precut_calc::calculator::{Figure, Item, Role};

/// Patterns for things of one role with different names, before they repeat.
const VARIANTS: usize = 6;

/// Dark rules are for screens only: paper stays white.
pub(super) const CSS: &str = "\
.precut-figure{font-family:system-ui,'Segoe UI',Roboto,'DejaVu Sans',Arial,sans-serif;font-size:12.5px;font-variant-numeric:tabular-nums}\
.precut-figure .paper{fill:#fff}\
.precut-figure text{fill:#1a1d21}\
.precut-figure .title{font-size:17px;font-weight:600}\
.precut-figure .name{font-weight:600}\
.precut-figure .grid{fill:none}\
.precut-figure .fine{stroke-opacity:.55}\
.precut-figure .zero,.precut-figure .frame{fill:none}\
.precut-figure .line{fill:none;stroke:currentColor;stroke-width:1.9;stroke-linejoin:round}\
.precut-figure .dot{fill:currentColor;stroke:none}\
.precut-figure .band{fill:currentColor;fill-opacity:.2;stroke:none}\
.precut-figure .edge{fill:none;stroke:currentColor;stroke-width:1}\
.precut-figure .points{fill:none;stroke:currentColor;stroke-width:1.5}\
.precut-figure .outline{fill:currentColor;fill-opacity:.25;stroke:currentColor;stroke-width:1.2;stroke-linejoin:round}\
.precut-figure .glyph{fill:#fff;stroke:#1a1d21;stroke-width:1.2;stroke-linejoin:round}\
.precut-figure .solid{fill:#1a1d21}\
.precut-figure .nominal{stroke-width:1.3;stroke-dasharray:12 3 2 3}\
.precut-figure .before{stroke-dasharray:8 4}\
.precut-figure .command{stroke-dasharray:16 4}\
.precut-figure .comparison{stroke-dasharray:2.5 3}\
.precut-figure .part.outline{fill-opacity:1}\
.precut-figure .stock{stroke-dasharray:4 3;fill-opacity:.1}\
.precut-figure .tolerance.edge{stroke-dasharray:5 3}\
.precut-figure .tolerance.line{stroke-dasharray:10 3 2 3 2 3}\
.precut-figure .uncertainty.line{stroke-dasharray:4 2 1 2}\
.precut-figure .limit.line{stroke-width:2.8}\
.precut-figure .unstable{stroke-dasharray:4 3}\
.precut-figure .n1{stroke-dasharray:8 4}\
.precut-figure .n2{stroke-dasharray:2.5 3}\
.precut-figure .n3{stroke-dasharray:12 3 2 3}\
.precut-figure .n4{stroke-dasharray:16 4}\
.precut-figure .n5{stroke-dasharray:5 2 1 2 1 2}\
.precut-figure .n6{stroke-dasharray:5 2}\
.precut-figure .n7{stroke-dasharray:10 3 2 3 2 3}\
.precut-figure .v1{stroke-dasharray:5 2}\
.precut-figure .v2{stroke-dasharray:2 2}\
.precut-figure .v3{stroke-dasharray:10 3 2 3}\
.precut-figure .v4{stroke-dasharray:14 3 5 3}\
.precut-figure .v5{stroke-dasharray:5 2 1 2 1 2}\
.precut-figure .points,.precut-figure .dot,.precut-figure .bars{stroke-dasharray:none}\
.precut-figure .bars{fill:currentColor;fill-opacity:.85;stroke:currentColor;stroke-width:.8}\
.precut-figure .bars.nominal,.precut-figure .bars.before,.precut-figure .bars.comparison,.precut-figure .bars.n1,\
.precut-figure .bars.n3,.precut-figure .bars.n5,.precut-figure .bars.n7{fill-opacity:.2}\
.precut-figure .casing{stroke:#fff;stroke-width:4.6;stroke-opacity:.7}\
.precut-figure .hatch{fill:url(#precut-hatch)}\
.precut-figure .over{stroke:#1a1d21;stroke-opacity:.14}\
.precut-figure .halo{stroke:#fff;stroke-width:3;stroke-linejoin:round;paint-order:stroke}\
#precut-hatch path{stroke:#1a1d21;stroke-width:.7;stroke-opacity:.45}\
@media screen and (prefers-color-scheme:dark){\
.precut-figure .paper{fill:#15181c}\
.precut-figure text{fill:#e8eaed}\
.precut-figure .glyph{fill:#15181c;stroke:#e8eaed}\
.precut-figure .solid{fill:#e8eaed}\
.precut-figure .over{stroke:#e8eaed}\
.precut-figure .halo,.precut-figure .casing{stroke:#15181c}\
#precut-hatch path{stroke:#fff}\
}";

/// Where there are ribbons.
pub(super) const RIBBONS: &str = "\
.precut-figure .ribbon{fill:currentColor;fill-opacity:.24;stroke:currentColor;stroke-width:1;stroke-dasharray:none}\
.precut-figure .weave-1,.precut-figure .weave-2,.precut-figure .weave-3,.precut-figure .weave-4,.precut-figure .weave-5{stroke:none}\
.precut-figure .weave-1{fill:url(#precut-weave-1)}\
.precut-figure .weave-2{fill:url(#precut-weave-2)}\
.precut-figure .weave-3{fill:url(#precut-weave-3)}\
.precut-figure .weave-4{fill:url(#precut-weave-4)}\
.precut-figure .weave-5{fill:url(#precut-weave-5)}\
pattern[id^=precut-weave] path{stroke:#1a1d21;stroke-opacity:.4}\
@media screen and (prefers-color-scheme:dark){pattern[id^=precut-weave] path{stroke:#fff}}";

/// A thin line across everything that is so filled.
pub(super) const HATCH: &str = "<defs><pattern id=\"precut-hatch\" width=\"7\" height=\"7\" \
patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\"><path d=\"M0 0V7\"/></pattern></defs>\n";

/// The class of a role, and its marker as a path round the origin.
pub(super) fn role_class(role: Role) -> (&'static str, &'static str) {
    const CIRCLE: &str = "m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0";
    const SQUARE: &str = "m-3-3h6v6h-6z";
    const DIAMOND: &str = "m0-4l4 4l-4 4l-4-4z";
    const TRIANGLE: &str = "m0-4l3.8 6.5h-7.6z";
    const DOWNWARD: &str = "m0 4l3.8-6.5h-7.6z";
    const PLUS: &str = "m-4 0h8m-4-4v8";
    const CROSS: &str = "m-3-3l6 6m0-6l-6 6";
    const BAR: &str = "m0-4v8";
    const SERIES: [(&str, &str); 8] = [
        ("n0", CIRCLE),
        ("n1", SQUARE),
        ("n2", TRIANGLE),
        ("n3", DIAMOND),
        ("n4", CROSS),
        ("n5", PLUS),
        ("n6", BAR),
        ("n7", DOWNWARD),
    ];
    match role {
        Role::Nominal => ("nominal", PLUS),
        Role::Before => ("before", CROSS),
        Role::After => ("after", SQUARE),
        Role::Command => ("command", DIAMOND),
        Role::Comparison => ("comparison", TRIANGLE),
        Role::Part => ("part", CIRCLE),
        Role::Stock => ("stock", CIRCLE),
        Role::Tolerance => ("tolerance", BAR),
        Role::Uncertainty => ("uncertainty", BAR),
        Role::Limit => ("limit", BAR),
        Role::Stable => ("stable", CIRCLE),
        Role::Unstable => ("unstable", CROSS),
        Role::Series(n) => SERIES[usize::from(n) % SERIES.len()],
        Role::Plain => ("plain", CIRCLE),
    }
}

/// Name and role of what has an entry in the legend.
pub(super) fn identity(item: &Item) -> Option<(&'static str, Role)> {
    match *item {
        Item::Line { name, role, .. }
        | Item::Band { name, role, .. }
        | Item::Points { name, role, .. }
        | Item::Bars { name, role, .. }
        | Item::Ribbon { name, role, .. }
        | Item::Outline { name, role, .. } => Some((name, role)),
        Item::HeatMap { .. } | Item::Glyph { .. } | Item::Handle(_) | Item::Setting(_) => None,
    }
}

/// Whether an area of this role is hatched, to be told from one of the other kind without colour.
pub(super) fn is_hatched(role: Role) -> bool {
    matches!(role, Role::Unstable | Role::Limit)
}

/// Whether anything in a figure is hatched.
pub(super) fn has_hatching(figure: &Figure) -> bool {
    figure.panels.iter().flat_map(|panel| &panel.items).any(|item| match item {
        Item::HeatMap { diverging, .. } => *diverging,
        Item::Band { role, .. } => is_hatched(*role),
        _ => false,
    })
}

/// Gives every name of a figure its classes: equal names look equal in all panels, different names
/// of one role differ in their pattern.
#[derive(Debug)]
pub(super) struct Styles(BTreeMap<(&'static str, &'static str), usize>);

impl Styles {
    pub(super) fn of(figure: &Figure) -> Self {
        let mut counts: BTreeMap<&'static str, usize> = BTreeMap::new();
        let mut variants = BTreeMap::new();
        for (name, role) in figure.panels.iter().flat_map(|panel| &panel.items).filter_map(identity) {
            let class = role_class(role).0;
            variants.entry((class, name)).or_insert_with(|| {
                let count = counts.entry(class).or_default();
                *count += 1;
                (*count - 1) % VARIANTS
            });
        }
        Self(variants)
    }

    /// Classes beside that of the kind.
    pub(super) fn class(&self, name: &'static str, role: Role) -> String {
        let class = role_class(role).0;
        match self.0.get(&(class, name)) {
            Some(0) | None => class.to_owned(),
            Some(variant) => format!("{class} v{variant}"),
        }
    }
}
