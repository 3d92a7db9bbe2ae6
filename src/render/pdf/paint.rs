//! Pages as they are written.

use std::num::NonZeroU16;

use krilla::configure::{Archival, ConfigurationBuilder, PdfVersion};
use krilla::destination::XyzDestination;
use krilla::error::KrillaError;
use krilla::geom::{PathBuilder, Point, Rect, Size, Transform};
use krilla::metadata::{DateTime, Metadata};
use krilla::num::NormalizedF32;
use krilla::outline::{Outline, OutlineNode};
use krilla::page::PageSettings;
use krilla::paint::{Fill, FillRule};
use krilla::surface::Surface;
use krilla::tagging::{
    Artifact, ArtifactType, ContentTag, Identifier, ListNumbering, Node, SpanTag, TableHeaderScope, Tag, TagGroup,
    TagKind, TagTree,
};
use krilla::{Document, SerializeSettings};
use krilla_svg::{SurfaceExt, SvgSettings};

use super::PdfError;
use super::face::printable;
use super::layout::{Element, Inside, Kind, LEFT, Layout, Mark, PAGE, Piece, WIDTH};
use super::style::{FOOT, RULE, color};
use crate::render::report::{Counted, Counts, Report};

/// From the edge of the paper to what stands at its foot, points.
const FOOT_Y: f32 = PAGE.1 - 40.0;

/// The document, or which rule it breaks.
pub(super) fn painted(
    layout: &Layout,
    parts: &[Element],
    report: &Report,
    counts: Counts<'_>,
) -> Result<Vec<u8>, PdfError> {
    let configuration = ConfigurationBuilder::new()
        .with_version(PdfVersion::Pdf17)
        .with_archival_validator(Archival::A2_A)
        .finish()
        .map_err(|error| PdfError::Document(format!("{error:?}")))?;
    let mut document = Document::new_with(SerializeSettings { configuration, ..SerializeSettings::default() });
    let mut places: Vec<Option<Identifier>> = vec![None; layout.leaves];
    for (index, pieces) in layout.pages.iter().enumerate() {
        let settings = PageSettings::from_wh(PAGE.0, PAGE.1).expect("paper has a size");
        let mut page = document.start_page_with(settings);
        let mut surface = page.surface();
        for piece in pieces {
            draw(&mut surface, piece, &mut places);
        }
        foot(&mut surface, report, &counts(Counted::Page(index + 1, layout.pages.len())));
        surface.finish();
        page.finish();
    }
    document.set_metadata(metadata(report));
    document.set_outline(outline(layout));
    let mut tree = TagTree::new().with_lang(Some(report.language.to_owned()));
    for part in parts {
        tree.push(group(part, &places));
    }
    document.set_tag_tree(tree);
    document.finish().map_err(|error| PdfError::Document(told(&error)))
}

/// The rules of the standard that are broken, not the fonts that they are broken with.
fn told(error: &KrillaError) -> String {
    let mut told = match error {
        KrillaError::Validation(errors) => {
            format!("{:?}", errors.iter().map(|(error, _)| error).take(3).collect::<Vec<_>>())
        }
        other => other.to_string(),
    };
    told.truncate(told.char_indices().nth(400).map_or(told.len(), |(end, _)| end));
    told
}

/// The same answer gives the same bytes, so its paper has no date of its own; the standard asks for one.
const NO_DATE: u16 = 2000;

fn metadata(report: &Report) -> Metadata {
    let title = format!("{}: {}", report.title, report.question);
    Metadata::new()
        .title(printable(&title))
        .description(printable(&report.signature))
        .language(report.language.to_owned())
        .creator("precut".to_owned())
        .producer("precut".to_owned())
        .creation_date(
            DateTime::new(NO_DATE).month(1).day(1).hour(0).minute(0).second(0).utc_offset_hour(0).utc_offset_minute(0),
        )
        .document_id(report.signature.clone())
}

fn outline(layout: &Layout) -> Outline {
    let mut outline = Outline::new();
    for entry in &layout.outline {
        let place = XyzDestination::new(entry.page, Point::from_xy(0.0, entry.y));
        outline.push_child(OutlineNode::new(entry.text.clone(), place));
    }
    outline
}

fn draw(surface: &mut Surface<'_>, piece: &Piece, places: &mut [Option<Identifier>]) {
    match piece.leaf {
        Some(leaf) => {
            let is_picture = piece.marks.iter().any(|mark| matches!(mark, Mark::Picture { .. }));
            let tag = if is_picture { ContentTag::Other } else { ContentTag::Span(SpanTag::empty()) };
            places[leaf] = Some(surface.start_tagged(tag));
        }
        None => drop(surface.start_tagged(ContentTag::Artifact(Artifact::with_kind(ArtifactType::Other)))),
    }
    piece.marks.iter().for_each(|mark| self::mark(surface, mark));
    surface.end_tagged();
}

fn mark(surface: &mut Surface<'_>, mark: &Mark) {
    match mark {
        Mark::Text { x, y, line } => {
            let mut x = *x;
            fill(surface, line.style.color);
            for run in &line.runs {
                let place = Point::from_xy(x, y + line.style.rise());
                surface.draw_glyphs(place, &run.glyphs, run.font(), &run.text, line.style.size, false);
                x += run.width * line.style.size;
            }
        }
        Mark::Area { x, y, width, height, color } => {
            let Some(area) = Rect::from_xywh(*x, *y, *width, *height) else { return };
            let mut path = PathBuilder::new();
            path.push_rect(area);
            if let Some(path) = path.finish() {
                fill(surface, *color);
                surface.draw_path(&path);
            }
        }
        Mark::Picture { x, y, width, tree } => {
            let height = width * tree.size().height() / tree.size().width();
            if let Some(size) = Size::from_wh(*width, height) {
                surface.push_transform(&Transform::from_translate(*x, *y));
                surface.draw_svg(tree, size, SvgSettings::default());
                surface.pop();
            }
        }
    }
}

fn fill(surface: &mut Surface<'_>, own: (u8, u8, u8)) {
    surface.set_stroke(None);
    surface.set_fill(Some(Fill { paint: color(own).into(), opacity: NormalizedF32::ONE, rule: FillRule::default() }));
}

/// What made the answer, and the number of the page.
fn foot(surface: &mut Surface<'_>, report: &Report, number: &str) {
    surface.start_tagged(ContentTag::Artifact(Artifact::with_kind(ArtifactType::Footer)));
    mark(surface, &Mark::Area { x: LEFT, y: FOOT_Y - 5.0, width: WIDTH, height: 0.4, color: RULE });
    mark(surface, &Mark::Text { x: LEFT, y: FOOT_Y, line: FOOT.line(&report.signature) });
    let number = FOOT.line(number);
    mark(surface, &Mark::Text { x: LEFT + WIDTH - number.width, y: FOOT_Y, line: number });
    surface.end_tagged();
}

/// A part of the text with what belongs to it.
fn group(element: &Element, places: &[Option<Identifier>]) -> Node {
    let inside = element.inside.iter().filter_map(|inside| match inside {
        Inside::Element(element) => Some(group(element, places)),
        Inside::Leaf(leaf) => places[*leaf].map(Node::Leaf),
    });
    Node::Group(TagGroup::with_children(tag(&element.kind), inside.collect()))
}

fn tag(kind: &Kind) -> TagKind {
    match kind {
        Kind::Heading(level, text) => {
            Tag::Hn(NonZeroU16::new(*level).unwrap_or(NonZeroU16::MIN), Some(spoken(text))).into()
        }
        Kind::Paragraph => Tag::P.into(),
        Kind::List => Tag::L(ListNumbering::Disc).into(),
        Kind::Item => Tag::LI.into(),
        Kind::ItemText => Tag::LBody.into(),
        Kind::Table => Tag::Table.into(),
        Kind::Row => Tag::TR.into(),
        Kind::Head => Tag::TH(TableHeaderScope::Both).into(),
        Kind::Cell => Tag::TD.into(),
        Kind::Figure(seen) => Tag::Figure(Some(spoken(seen))).into(),
        Kind::Formula(text) => Tag::Formula(Some(spoken(text))).into(),
    }
}

/// What is said in place of something: the standard asks that it be something.
fn spoken(text: &str) -> String {
    if text.trim().is_empty() { "–".to_owned() } else { text.to_owned() }
}
