//! Contradictions from outside: a simulated drive, spoiled in every way that has a name.

mod drive;
mod honest;
mod path;
mod spoiled;
