//! OpenCV's `FileStorage` in XML as the same tree of keys, numbers and lists that its YAML gives.
//!
//! ```xml
//! <?xml version="1.0"?>
//! <opencv_storage>
//! <image_width>640</image_width>
//! <camera_matrix type_id="opencv-matrix">
//!   <rows>3</rows><cols>3</cols><dt>d</dt>
//!   <data>756. 0. 319.5 0. 756. 239.5 0. 0. 1.</data></camera_matrix>
//! </opencv_storage>
//! ```
//!
//! An element with elements inside is a mapping of them, one with several words a list, one with one word a value;
//! `data` is always a list.

use std::path::Path;

use roxmltree::{Document, Node};
use saphyr::{AnnotatedMapping, MarkedYaml, Marker, Scalar, YamlData};

use super::file::file_fault;
use crate::error::SequenceError;
use crate::text::line_fault;

/// Deepest nesting that is followed; a calibration has three.
const MOST_NESTED: usize = 16;

/// The top of the tree.
pub(super) fn load(path: &Path, text: &str) -> Result<Vec<MarkedYaml<'static>>, SequenceError> {
    let document = Document::parse(text).map_err(|error| {
        line_fault(
            path,
            u64::from(error.pos().row),
            "XML",
            error.to_string().replace('\n', " "),
        )
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "opencv_storage" {
        return Err(file_fault(
            path,
            "an OpenCV FileStorage (<opencv_storage>)",
            format!("<{}>", root.tag_name().name()),
        ));
    }
    Ok(vec![value(&document, root, 0)])
}

fn value(document: &Document<'_>, node: Node<'_, '_>, depth: usize) -> MarkedYaml<'static> {
    let at = document.text_pos_at(node.range().start);
    let marker = Marker::new(node.range().start, at.row as usize, at.col as usize);
    marked(contents(document, node, depth, marker), marker)
}

fn contents(
    document: &Document<'_>,
    node: Node<'_, '_>,
    depth: usize,
    marker: Marker,
) -> YamlData<'static, MarkedYaml<'static>> {
    let elements = || node.children().filter(Node::is_element);
    if elements().next().is_some() && depth < MOST_NESTED {
        let children: AnnotatedMapping<'static, MarkedYaml<'static>> = elements()
            .map(|child| {
                let value = value(document, child, depth + 1);
                let mut key = MarkedYaml::from(word(child.tag_name().name()));
                key.span = value.span;
                (key, value)
            })
            .collect();
        return YamlData::Mapping(children);
    }
    let text: String = node
        .children()
        .filter_map(|child| child.text())
        .collect::<Vec<_>>()
        .join(" ");
    let words: Vec<&str> = text.split_ascii_whitespace().collect();
    match words.as_slice() {
        [single] if node.tag_name().name() != "data" => word(single.trim_matches('"')),
        _ => YamlData::Sequence(
            words
                .iter()
                .map(|text| marked(word(text), marker))
                .collect(),
        ),
    }
}

fn marked(data: YamlData<'static, MarkedYaml<'static>>, marker: Marker) -> MarkedYaml<'static> {
    let mut marked = MarkedYaml::from(data);
    marked.span.start = marker;
    marked.span.end = marker;
    marked
}

fn word(text: &str) -> YamlData<'static, MarkedYaml<'static>> {
    YamlData::Value(Scalar::String(text.to_owned().into()))
}
