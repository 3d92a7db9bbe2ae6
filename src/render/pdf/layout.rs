//! What stands where on which page, and what it is: its logical order for those who hear the report.

use usvg::Tree;

use super::style::{Line, Style};

/// A4, points.
pub(super) const PAGE: (f32, f32) = (595.28, 841.89);
/// Left of the text.
pub(super) const LEFT: f32 = 54.0;
/// How wide the text is.
pub(super) const WIDTH: f32 = PAGE.0 - 2.0 * LEFT;
/// Where a page begins.
const TOP: f32 = 52.0;
/// Where it ends.
const BOTTOM: f32 = PAGE.1 - 58.0;

/// Something to be drawn. Places are those of its upper left corner, points from that of the page.
#[derive(Debug)]
pub(super) enum Mark {
    /// Letters.
    Text { x: f32, y: f32, line: Line },
    /// A filled area.
    Area { x: f32, y: f32, width: f32, height: f32, color: (u8, u8, u8) },
    /// A picture, as wide as it says.
    Picture { x: f32, y: f32, width: f32, tree: Box<Tree> },
}

/// Marks that belong together, on one page.
#[derive(Debug)]
pub(super) struct Piece {
    /// Where they stand in the logical order; nowhere if they are decoration.
    pub(super) leaf: Option<usize>,
    pub(super) marks: Vec<Mark>,
}

/// A part of the text in its logical order.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) kind: Kind,
    pub(super) inside: Vec<Inside>,
}

/// What a part of the text is.
#[derive(Debug, Clone)]
pub(super) enum Kind {
    /// A heading of that level, and what it says.
    Heading(u16, String),
    Paragraph,
    List,
    Item,
    ItemText,
    Table,
    Row,
    Head,
    Cell,
    /// A picture, and what can be seen.
    Figure(String),
    /// A formula, as text.
    Formula(String),
}

#[derive(Debug)]
pub(super) enum Inside {
    Element(Element),
    Leaf(usize),
}

impl Element {
    pub(super) fn new(kind: Kind, inside: Vec<Self>) -> Self {
        Self { kind, inside: inside.into_iter().map(Inside::Element).collect() }
    }

    pub(super) fn of_leaves(kind: Kind, leaves: Vec<usize>) -> Self {
        Self { kind, inside: leaves.into_iter().map(Inside::Leaf).collect() }
    }
}

/// A heading and where it stands, for the outline.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) text: String,
    pub(super) page: usize,
    pub(super) y: f32,
}

/// The pages so far.
pub(super) struct Layout {
    pub(super) pages: Vec<Vec<Piece>>,
    pub(super) outline: Vec<Entry>,
    /// Where the next thing begins on the last page.
    pub(super) y: f32,
    pub(super) leaves: usize,
}

impl Layout {
    pub(super) fn new() -> Self {
        Self { pages: vec![Vec::new()], outline: Vec::new(), y: TOP, leaves: 0 }
    }

    /// Points that are left on this page.
    pub(super) fn room(&self) -> f32 {
        BOTTOM - self.y
    }

    /// Points of a whole page.
    pub(super) const fn page_room() -> f32 {
        BOTTOM - TOP
    }

    pub(super) fn is_at_top(&self) -> bool {
        self.y <= TOP
    }

    /// Goes on to the next page unless so much fits here; whether it did.
    pub(super) fn need(&mut self, height: f32) -> bool {
        let turns = height > self.room() && !self.is_at_top();
        if turns {
            self.pages.push(Vec::new());
            self.y = TOP;
        }
        turns
    }

    /// Leaves room before the next thing, but not at the top of a page.
    pub(super) fn skip(&mut self, height: f32) {
        if !self.is_at_top() {
            self.y += height;
        }
    }

    /// Puts marks of one leaf on this page.
    pub(super) fn put(&mut self, marks: Vec<Mark>) -> usize {
        let leaf = self.leaves;
        self.leaves += 1;
        self.push(Piece { leaf: Some(leaf), marks });
        leaf
    }

    /// Puts decoration on this page.
    pub(super) fn decorate(&mut self, marks: Vec<Mark>) {
        self.push(Piece { leaf: None, marks });
    }

    fn push(&mut self, piece: Piece) {
        if let Some(page) = self.pages.last_mut() {
            page.push(piece);
        }
    }

    /// Lines under each other from `x` on, over as many pages as it takes.
    pub(super) fn lines(&mut self, lines: Vec<Line>, x: f32) -> Vec<usize> {
        let mut leaves = Vec::new();
        let mut marks = Vec::new();
        for line in lines {
            let leading = line.style.leading();
            if leading > self.room() && !marks.is_empty() {
                leaves.push(self.put(std::mem::take(&mut marks)));
            }
            self.need(leading);
            marks.push(Mark::Text { x, y: self.y, line });
            self.y += leading;
        }
        if !marks.is_empty() {
            leaves.push(self.put(marks));
        }
        leaves
    }

    /// A paragraph.
    pub(super) fn paragraph(&mut self, text: &str, style: Style, (x, room): (f32, f32)) -> Element {
        let lines = style.lines(text, room);
        Element::of_leaves(Kind::Paragraph, self.lines(lines, x))
    }

    /// A heading that keeps room for what it stands above.
    pub(super) fn heading(&mut self, text: &str, style: Style, level: u16, below: f32) -> Element {
        let lines = style.lines(text, WIDTH);
        self.need(style.leading() * lines.len() as f32 + below);
        if level <= 2 {
            self.outline.push(Entry { text: super::face::printable(text), page: self.pages.len() - 1, y: self.y });
        }
        Element::of_leaves(Kind::Heading(level, super::face::printable(text)), self.lines(lines, LEFT))
    }

    /// The heading of a section.
    pub(super) fn section(&mut self, text: &str) -> Element {
        self.skip(16.0);
        let heading = self.heading(text, super::style::HEADING, 2, 70.0);
        self.y += 3.0;
        heading
    }

    /// How high a picture is.
    pub(super) fn picture_height(tree: &Tree) -> f32 {
        Self::page_room().min(WIDTH * tree.size().height() / tree.size().width())
    }

    /// A picture as wide as the text, or as high as a page.
    pub(super) fn picture(&mut self, tree: Tree, description: &str) -> Element {
        let size = tree.size();
        let height = Self::picture_height(&tree);
        let width = height * size.width() / size.height();
        self.need(height);
        let leaf = self.put(vec![Mark::Picture { x: LEFT, y: self.y, width, tree: Box::new(tree) }]);
        self.y += height;
        let leaves = vec![leaf];
        Element::of_leaves(Kind::Figure(super::face::printable(description)), leaves)
    }
}
