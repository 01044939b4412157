//! The tree of nodes: where each stands, posed or at rest.

use std::collections::HashMap;

use super::Problem;
use super::animation::{NodePose, Pose};
use super::json::Cursor;
use crate::math::{DAffine3, DMat4, DQuat, DVec3};

/// The nodes of a file in their pose.
pub(super) struct Hierarchy<'a, 'b> {
    root: Cursor<'a>,
    pose: &'b Pose,
    /// Parents by child; made when first asked for.
    parents: Option<HashMap<usize, usize>>,
    /// World from node, of those that were asked for.
    worlds: HashMap<usize, DAffine3>,
}

impl<'a, 'b> Hierarchy<'a, 'b> {
    /// The nodes of the document `root`.
    pub(super) fn new(root: Cursor<'a>, pose: &'b Pose) -> Self {
        Self {
            root,
            pose,
            parents: None,
            worlds: HashMap::new(),
        }
    }

    /// What animations set on a node.
    pub(super) fn pose(&self, index: usize) -> Option<&'b NodePose> {
        self.pose.get(&index)
    }

    /// A node's own transform.
    pub(super) fn local(&self, index: usize, node: &Cursor<'_>) -> Result<DAffine3, Problem> {
        local(node, self.pose(index))
    }

    /// Where the node stands whose index is at `from`, wherever in the tree it is.
    pub(super) fn world(&mut self, from: &Cursor<'a>) -> Result<DAffine3, Problem> {
        if self.parents.is_none() {
            self.parents = Some(parents(&self.root)?);
        }
        // Up to a node whose place is known, then down again.
        let mut chain = Vec::new();
        let mut at = Some(from.index()?);
        let mut world = DAffine3::IDENTITY;
        let most = self.parents.as_ref().map_or(0, HashMap::len) + 1;
        while let Some(index) = at {
            if let Some(known) = self.worlds.get(&index) {
                world = *known;
                break;
            }
            if chain.len() > most {
                return Err(from.problem("is part of a cycle of nodes"));
            }
            chain.push(index);
            at = self.parents.as_ref().and_then(|p| p.get(&index)).copied();
        }
        for index in chain.into_iter().rev() {
            let node = self.root.element("nodes", index, from)?;
            world *= self.local(index, &node)?;
            self.worlds.insert(index, world);
        }
        Ok(world)
    }
}

/// The parent of each node that has one.
fn parents(root: &Cursor<'_>) -> Result<HashMap<usize, usize>, Problem> {
    let mut parents = HashMap::new();
    for (i, node) in root.items("nodes")?.iter().enumerate() {
        for child in node.items("children")? {
            parents.insert(child.index()?, i);
        }
    }
    Ok(parents)
}

/// The transform of a node, with what a pose sets in place of the node's own.
fn local(node: &Cursor<'_>, pose: Option<&NodePose>) -> Result<DAffine3, Problem> {
    if node.get("matrix").is_some() {
        let m: [f64; 16] = node.numbers_or("matrix", DMat4::IDENTITY.to_cols_array())?;
        return Ok(DAffine3::from_mat4(DMat4::from_cols_array(&m)));
    }
    let t = node.numbers_or("translation", [0.0; 3])?;
    let r: [f64; 4] = node.numbers_or("rotation", [0.0, 0.0, 0.0, 1.0])?;
    let s = node.numbers_or("scale", [1.0; 3])?;
    let q = DQuat::from_array(r);
    let q = if q.length_squared() > 0.0 {
        q.normalize()
    } else {
        DQuat::IDENTITY
    };
    let (t, s) = (DVec3::from_array(t), DVec3::from_array(s));
    let (t, q, s) = match pose {
        None => (t, q, s),
        Some(p) => (
            p.translation.unwrap_or(t),
            p.rotation.unwrap_or(q),
            p.scale.unwrap_or(s),
        ),
    };
    Ok(DAffine3::from_scale_rotation_translation(s, q, t))
}
