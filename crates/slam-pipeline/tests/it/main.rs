//! The SLAM system through its public interface.

#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a helper that cannot go on fails its test; an attack tells its time"
)]

mod budget;
mod drive;
mod frame_loop;
mod hostile;
mod hostile_features;
#[path = "../../../slam-io/tests/it/hostile/mutations.rs"]
mod mutations;
mod old_places;
mod refused_frames;
mod rendered;
mod row_rate;
mod sightings;
mod stored_state;
mod twin_posters;
mod wrong_matches;
