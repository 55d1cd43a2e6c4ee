//! Rao-Blackwellized particle filter: log weights, resampling, copy-on-write maps, counter-based random streams.
