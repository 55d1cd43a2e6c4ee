//! Rings of files that use one another, by breadth-first search: a crate has some dozens of files.

use super::resolve::Edge;
use std::collections::VecDeque;

/// For every group of two or more files that reach one another, a shortest ring through the first of them.
pub(super) fn cycles(files: usize, edges: &[Edge]) -> Vec<Vec<Edge>> {
    let mut taken = vec![false; files];
    let mut rings = Vec::new();
    for first in 0..files {
        if taken[first] {
            continue;
        }
        let Some(ring) = shortest_path(files, edges, first, first) else {
            continue;
        };
        // The others of the group are told of once it is known that the ring is broken.
        for (other, taken) in taken.iter_mut().enumerate() {
            let reaches = |from, to| shortest_path(files, edges, from, to).is_some();
            *taken |= reaches(first, other) && reaches(other, first);
        }
        rings.push(ring);
    }
    rings
}

/// The edges of a shortest path of one edge or more.
fn shortest_path(files: usize, edges: &[Edge], from: usize, to: usize) -> Option<Vec<Edge>> {
    let mut arrived: Vec<Option<&Edge>> = vec![None; files];
    let mut open = VecDeque::from([from]);
    while arrived[to].is_none() {
        let at = open.pop_front()?;
        for edge in edges.iter().filter(|edge| edge.from == at) {
            if arrived[edge.to].is_none() {
                arrived[edge.to] = Some(edge);
                open.push_back(edge.to);
            }
        }
    }
    let mut path = Vec::new();
    let mut at = to;
    while let Some(edge) = arrived[at] {
        path.push(edge.clone());
        at = edge.from;
        if at == from {
            break;
        }
    }
    path.reverse();
    Some(path)
}
