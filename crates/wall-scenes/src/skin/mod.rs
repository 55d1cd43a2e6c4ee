//! Skins: the pictures on the rectangles of a scene.
//!
//! From the bottom up: a raster in metres (`canvas`), random drawing material (`draw`), sheets of paper (`sheet`),
//! bare surfaces (`surface`), things with a front (`object`), the kinds of skin (`kind`), whole walls (`wall_plan`),
//! all skins of a scene (`paint`).

mod canvas;
pub(crate) mod draw;
pub(crate) mod kind;
mod object;
pub(crate) mod paint;
mod sheet;
pub(crate) mod surface;
pub(crate) mod wall_plan;
