//! Workspace tasks as a library: scenes, fixtures, the gate.

pub mod scene;
