//! Nearest neighbours of 128-byte descriptors in a map that grows every frame.
