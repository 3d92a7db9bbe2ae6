//! Which calculators take names, and of what kind of machine and tool.

use precut_calc::calculator::Finding;

use super::view::Views;
use super::writer::Writer;
use crate::record::Kind;

/// Calculators that take the same fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Room {
    /// A shaft, how it is held, one cut.
    Deflection,
    /// A shaft in zones.
    Schedule,
    /// A cutter and a spindle.
    Milling,
    /// The same in three directions: its cutter is named where it stands.
    Cutter,
    /// A ring: its material alone.
    Ring,
    /// A program with its blank and the tools of its turret.
    Program,
}

impl Room {
    /// The room of a calculator; `None` where it takes no names.
    pub(super) fn of(calculator: &str) -> Option<Self> {
        match calculator {
            "deflection-compensation" => Some(Self::Deflection),
            "feed-schedule" => Some(Self::Schedule),
            "program-compensation" => Some(Self::Program),
            "ring-roundness" => Some(Self::Ring),
            "fixture-stability" => Some(Self::Milling),
            "milling-stability" => Some(Self::Cutter),
            _ => None,
        }
    }

    /// Whether its jobs name records of that kind.
    pub(super) fn takes(self, kind: Kind) -> bool {
        match self {
            Self::Ring => kind == Kind::Material,
            // Tools have a place of their own there: `edges`.
            Self::Program | Self::Cutter => kind != Kind::Tool,
            _ => true,
        }
    }

    /// The field of what is turned.
    pub(super) fn work(self) -> &'static str {
        if self == Self::Program { "stock" } else { "shaft" }
    }

    fn kinds(self, kind: Kind) -> &'static [&'static str] {
        match (self, kind) {
            (Self::Milling | Self::Cutter, Kind::Machine) => &["mill"],
            (_, Kind::Machine) => &["lathe"],
            (Self::Milling | Self::Cutter, Kind::Tool) => &["milling_indexable", "milling_solid"],
            (_, Kind::Tool) => &["turning_external", "boring_bar"],
            (_, Kind::Material | Kind::Part) => &[],
        }
    }
}

/// Machine and tool must be of a kind that the calculator knows, and a holder one that turns along the shaft.
pub(super) fn check(room: Room, views: &Views<'_>, writer: &mut Writer<'_>) {
    let machine = views.machine.iter().map(|view| (view, "wrong_kind_of_machine"));
    for (view, code) in machine.chain(views.tools().map(|view| (view, "wrong_kind_of_tool"))) {
        let Some(kind) = view.text("kind") else { continue };
        let allowed = room.kinds(view.kind);
        if !allowed.contains(&kind) {
            writer.fault(
                Finding::new(code, view.pointer.clone())
                    .with("received", kind.to_owned())
                    .with("allowed", allowed.to_vec()),
            );
        }
    }
    if matches!(room, Room::Milling | Room::Cutter | Room::Ring) {
        return;
    }
    let Some(tool) = &views.tool else { return };
    if let Some(holder) = tool.codes.holder.as_ref().filter(|holder| holder.is_for_facing()) {
        writer.fault(
            Finding::new("holder_for_facing", tool.pointer.clone())
                .with("holder", holder.to_string())
                .with("style", holder.style.to_string()),
        );
    }
}
