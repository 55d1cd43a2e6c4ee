//! Pictures of a checkerboard with known truth.
//!
//! The board (`shape`), poses at which a camera sees all of it (`pose`), the image of one pose (`render`), a whole set in
//! a folder (`set`).

mod pose;
mod render;
mod set;
mod shape;

pub use pose::board_poses;
pub use render::{BoardRenderer, Look, Picture};
pub use set::{BoardSetSpec, write_board_set};
pub use shape::Board;
