//! Lists the topics of a log: `cargo run -p robot-logs --example list_topics -- LOG`.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::path::Path;

use robot_logs::{LogError, RobotLog};

fn main() -> Result<(), LogError> {
    let Some(path) = std::env::args_os().nth(1) else {
        println!("give the path of a .bag, .mcap or .db3 file or of a ROS 2 bag folder");
        return Ok(());
    };
    let log = RobotLog::open(Path::new(&path))?;
    println!("{}", log.format());
    for topic in log.topics() {
        let seconds = (topic.last_ns - topic.first_ns) as f64 * 1e-9;
        let read = if topic.kind.is_some() {
            ""
        } else {
            "  (not read)"
        };
        println!(
            "{:>8} in {seconds:8.2} s  {}  {}{read}",
            topic.messages, topic.name, topic.type_name
        );
    }
    for note in log.notes() {
        println!("note: {note}");
    }
    Ok(())
}
