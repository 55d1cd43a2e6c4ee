//! Single-camera geometry: cameras, SE(2)/SE(3), triangulation, inverse depth, epipolar constraints.
