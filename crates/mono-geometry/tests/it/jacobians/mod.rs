//! Every Jacobian of the cameras, the groups and the maps built on them, three ways: the formula of the crate, dual numbers through an
//! independent and naive formula, central differences of the crate's own function.

mod cameras;
mod dual;
mod groups;
mod maps;
