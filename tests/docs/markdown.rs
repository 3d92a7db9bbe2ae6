//! As much of Markdown as the documentation uses.

use std::path::Path;

/// A page.
pub(crate) struct Document {
    /// Path from the root of the project.
    pub(crate) name: String,
    pub(crate) text: String,
}

/// What stands between two fences.
pub(crate) struct Block {
    pub(crate) info: String,
    pub(crate) text: String,
    /// Line of the opening fence.
    pub(crate) line: usize,
}

/// The README and everything under `docs`.
pub(crate) fn documents(root: &Path) -> Vec<Document> {
    let mut names = vec!["README.md".to_owned()];
    collect(root, "docs", &mut names);
    names.iter().map(|name| Document::read(root, name)).collect()
}

fn collect(root: &Path, folder: &str, names: &mut Vec<String>) {
    for entry in std::fs::read_dir(root.join(folder)).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{folder}/{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            collect(root, &name, names);
        } else if Path::new(&name).extension().is_some_and(|extension| extension == "md") {
            names.push(name);
        }
    }
}

impl Document {
    pub(crate) fn read(root: &Path, name: &str) -> Self {
        let text = std::fs::read_to_string(root.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        Self { name: name.to_owned(), text }
    }

    pub(crate) fn blocks(&self) -> Vec<Block> {
        let mut blocks = Vec::new();
        let mut open: Option<Block> = None;
        for (index, line) in self.text.lines().enumerate() {
            match (&mut open, line.strip_prefix("```")) {
                (None, Some(info)) => {
                    open = Some(Block { info: info.to_owned(), text: String::new(), line: index + 1 });
                }
                (Some(_), Some(_)) => blocks.extend(open.take()),
                (Some(block), None) => {
                    block.text.push_str(line);
                    block.text.push('\n');
                }
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{}: a fence is not closed", self.name);
        blocks
    }

    /// Lines outside fences.
    fn prose(&self) -> impl Iterator<Item = &str> {
        let mut inside = false;
        self.text.lines().filter(move |line| {
            let fence = line.starts_with("```");
            inside ^= fence;
            !inside && !fence
        })
    }

    /// Headings without their hashes.
    pub(crate) fn headings(&self) -> impl Iterator<Item = &str> {
        self.prose().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim())
    }

    /// Anchors of the headings, as forges make them.
    pub(crate) fn anchors(&self) -> Vec<String> {
        let kept = |c: char| match c {
            ' ' => Some('-'),
            '-' | '_' => Some(c),
            _ if c.is_alphanumeric() => Some(c),
            _ => None,
        };
        self.headings().map(|heading| heading.to_lowercase().chars().filter_map(kept).collect()).collect()
    }

    /// Targets of links and images.
    pub(crate) fn links(&self) -> Vec<String> {
        let mut links = Vec::new();
        for line in self.prose() {
            for rest in line.split("](").skip(1) {
                links.extend(rest.split_once(')').map(|(target, _)| target.to_owned()));
            }
        }
        links
    }
}

impl Block {
    /// First word of the info string.
    pub(crate) fn language(&self) -> &str {
        self.info.split(' ').next().unwrap_or_default()
    }

    /// What the block is for; empty if it does not say.
    pub(crate) fn role(&self) -> &str {
        self.info.split_once(' ').map_or("", |(_, role)| role.trim())
    }
}
