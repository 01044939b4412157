//! Which of a file's scenes is rendered. glTF lets a file name none as its default, and have none.

use std::collections::HashSet;

use serde_json::{Value, json};

use super::json::Cursor;
use super::{ImportOptions, Problem};
use crate::scene::SceneBuilder;

/// Gives a document without scenes one of all its root nodes, and tells whether it did.
///
/// # Errors
/// Children that are no index of a node.
pub(super) fn complete(document: &mut Value) -> Result<bool, Problem> {
    let root = Cursor::root(document);
    let nodes = root.items("nodes")?;
    if root.get("scenes").is_some() || nodes.is_empty() {
        return Ok(false);
    }
    let mut below = HashSet::new();
    for node in &nodes {
        for child in node.items("children")? {
            below.insert(child.index()?);
        }
    }
    let roots: Vec<usize> = (0..nodes.len()).filter(|i| !below.contains(i)).collect();
    if let Some(fields) = document.as_object_mut() {
        fields.insert("scenes".into(), json!([{ "nodes": roots }]));
    }
    Ok(true)
}

/// The scene that is rendered: the one that was asked for, the file's default, or the first.
pub(super) fn chosen<'a>(
    root: &Cursor<'a>,
    options: &ImportOptions,
    builder: &mut SceneBuilder,
) -> Result<Cursor<'a>, Problem> {
    let scenes = root.items("scenes")?;
    let chosen = match (&options.scene, root.get("scene")) {
        (Some(name), _) => {
            let named = |s: &&Cursor<'_>| s.get("name").is_some_and(|n| n.value() == name.as_str());
            Some(scenes.iter().find(named).cloned().ok_or_else(|| {
                let known: Vec<String> = scenes.iter().map(Cursor::name).collect();
                Problem {
                    remedy: format!("known scenes: {}", known.join(", ")),
                    ..Problem::invalid("/scenes", format!("none is named '{name}'"))
                }
            })?)
        }
        (None, Some(at)) => Some(
            scenes
                .get(at.index()?)
                .cloned()
                .ok_or_else(|| at.problem("names a scene that does not exist"))?,
        ),
        (None, None) => {
            if scenes.len() > 1 {
                builder.inform(
                    "the file names no default scene: its first is shown; --scene names another",
                );
            }
            scenes.first().cloned()
        }
    };
    chosen.ok_or_else(|| Problem {
        remedy: "export the file with a scene".into(),
        ..Problem::invalid("/scenes", "the file holds no scene")
    })
}
