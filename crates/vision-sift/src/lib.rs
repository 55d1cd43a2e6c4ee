//! SIFT keypoints and descriptors (Lowe 2004) from a grey image.
