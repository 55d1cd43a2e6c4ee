//! The SLAM system through its public interface.

#![expect(
    clippy::unwrap_used,
    reason = "a helper that cannot go on fails its test"
)]

mod budget;
mod drive;
mod frame_loop;
mod old_places;
mod refused_frames;
mod row_rate;
mod sightings;
mod stored_state;
