//! The command line of `cargo xtask`: every command and flag in one place.

use crate::board::SetSpec;
use crate::scene::SceneSpec;
use crate::synth_eval::Options;
use anyhow::{anyhow, bail, ensure};
use lexopt::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// What `--help` prints.
pub const HELP: &str = "\
cargo xtask <command>

scene --out SEQ [--kind wall|room] [--seed S] [--frames N] [--noise-px LEVELS]
      render a sequence with ground truth; LEVELS is the pixel noise at mid grey
board --out DIR [--count N] [--seed S] [--width PX] [--noise LEVELS]
      render pictures of a 9x6 checkerboard with its true corners and camera, for mono-slam calibrate
fixtures [--check]
      rewrite fixtures/wall and fixtures/board, or verify that they are what would be written
synth-eval [--quick] [--seeds N] [--out DIR]
      compare the filters on N rendered walls; results, table and figures go to DIR (out/synth-eval)
tidy  check the rules of the tree
ci    formatting, clippy, tests, documentation, tidy
";

/// A parsed command line.
#[derive(Debug, Clone, PartialEq)]
pub enum Command {
    /// Print [`HELP`].
    Help,
    /// Render one sequence into a folder.
    Scene {
        /// Folder of the sequence.
        out: PathBuf,
        /// What to render.
        spec: SceneSpec,
    },
    /// Render pictures of a checkerboard into a folder.
    Board {
        /// The folder.
        out: PathBuf,
        /// What to render.
        spec: SetSpec,
    },
    /// Rewrite the fixtures, or verify them.
    Fixtures {
        /// Verify only.
        check: bool,
    },
    /// Compare the filters on rendered walls.
    SynthEval(Options),
    /// Check the rules of the tree.
    Tidy,
    /// The whole gate.
    Ci,
}

/// Reads a command line without the program's name.
///
/// # Errors
/// Anything unknown, missing or out of place, in one sentence.
pub fn parse(arguments: impl IntoIterator<Item = OsString>) -> anyhow::Result<Command> {
    let mut parser = lexopt::Parser::from_args(arguments);
    let name = match parser.next()? {
        None => bail!("a command is required: scene, board, fixtures, synth-eval, tidy or ci"),
        Some(Long("help") | Short('h')) => return Ok(Command::Help),
        Some(Value(name)) => name.string()?,
        Some(other) => return Err(other.unexpected().into()),
    };
    match name.as_str() {
        "scene" => scene(&mut parser),
        "board" => board(&mut parser),
        "fixtures" => fixtures(&mut parser),
        "synth-eval" => synth_eval(&mut parser),
        "tidy" => alone(&mut parser, Command::Tidy),
        "ci" => alone(&mut parser, Command::Ci),
        "help" => Ok(Command::Help),
        other => Err(anyhow!(
            "no command `{other}`: use scene, board, fixtures, synth-eval, tidy or ci"
        )),
    }
}

fn scene(parser: &mut lexopt::Parser) -> anyhow::Result<Command> {
    let (mut out, mut kind, mut seed) = (None, String::from("wall"), 1);
    let (mut frames, mut noise_px) = (None, None);
    while let Some(argument) = parser.next()? {
        match argument {
            Long("out") => out = Some(PathBuf::from(parser.value()?)),
            Long("kind") => kind = parser.value()?.string()?,
            Long("seed") => seed = parser.value()?.parse()?,
            Long("frames") => frames = Some(parser.value()?.parse()?),
            Long("noise-px") => noise_px = Some(parser.value()?.parse()?),
            Long("help") | Short('h') => return Ok(Command::Help),
            other => return Err(other.unexpected().into()),
        }
    }
    let mut spec = match kind.as_str() {
        "wall" => SceneSpec::wall(seed),
        "room" => SceneSpec::room(seed),
        other => bail!("--kind must be wall or room, not `{other}`"),
    };
    spec.frames = frames.unwrap_or(spec.frames);
    spec.noise_px = noise_px.unwrap_or(spec.noise_px);
    spec.check()?;
    let out = out.ok_or_else(|| anyhow!("scene needs --out SEQ"))?;
    ensure!(!out.as_os_str().is_empty(), "--out must not be empty");
    Ok(Command::Scene { out, spec })
}

fn board(parser: &mut lexopt::Parser) -> anyhow::Result<Command> {
    let (mut out, mut spec) = (None, SetSpec::small(20, 1));
    spec.image = (640, 480);
    while let Some(argument) = parser.next()? {
        match argument {
            Long("out") => out = Some(PathBuf::from(parser.value()?)),
            Long("count") => spec.count = parser.value()?.parse()?,
            Long("seed") => spec.seed = parser.value()?.parse()?,
            Long("width") => spec.image.0 = parser.value()?.parse()?,
            Long("noise") => spec.look.noise = parser.value()?.parse()?,
            Long("help") | Short('h') => return Ok(Command::Help),
            other => return Err(other.unexpected().into()),
        }
    }
    ensure!(
        (1..=1000).contains(&spec.count),
        "--count must be from 1 to 1000, not {}",
        spec.count
    );
    ensure!(
        (160..=8000).contains(&spec.image.0),
        "--width must be from 160 to 8000 pixels, not {}",
        spec.image.0
    );
    ensure!(
        (0.0..=50.0).contains(&spec.look.noise),
        "--noise must be from 0 to 50 levels, not {}",
        spec.look.noise
    );
    spec.image.1 = spec.image.0 * 3 / 4;
    let out = out.ok_or_else(|| anyhow!("board needs --out DIR"))?;
    ensure!(!out.as_os_str().is_empty(), "--out must not be empty");
    Ok(Command::Board { out, spec })
}

fn fixtures(parser: &mut lexopt::Parser) -> anyhow::Result<Command> {
    let mut check = false;
    while let Some(argument) = parser.next()? {
        match argument {
            Long("check") => check = true,
            Long("help") | Short('h') => return Ok(Command::Help),
            other => return Err(other.unexpected().into()),
        }
    }
    Ok(Command::Fixtures { check })
}

fn synth_eval(parser: &mut lexopt::Parser) -> anyhow::Result<Command> {
    let mut options = Options {
        quick: false,
        seeds: None,
        out: PathBuf::from("out/synth-eval"),
    };
    while let Some(argument) = parser.next()? {
        match argument {
            Long("quick") => options.quick = true,
            Long("seeds") => options.seeds = Some(parser.value()?.parse()?),
            Long("out") => options.out = PathBuf::from(parser.value()?),
            Long("help") | Short('h') => return Ok(Command::Help),
            other => return Err(other.unexpected().into()),
        }
    }
    options.seed_count()?;
    ensure!(
        !options.out.as_os_str().is_empty(),
        "--out must not be empty"
    );
    Ok(Command::SynthEval(options))
}

fn alone(parser: &mut lexopt::Parser, command: Command) -> anyhow::Result<Command> {
    match parser.next()? {
        None => Ok(command),
        Some(Long("help") | Short('h')) => Ok(Command::Help),
        Some(other) => Err(other.unexpected().into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> anyhow::Result<Command> {
        parse(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn every_flag_reaches_the_specification() {
        let line = "scene --out a/b --kind room --seed 9 --frames 12 --noise-px 1.5";
        let spec = SceneSpec {
            frames: 12,
            noise_px: 1.5,
            ..SceneSpec::room(9)
        };
        assert_eq!(
            read(line).unwrap(),
            Command::Scene {
                out: "a/b".into(),
                spec
            }
        );
        let mut board = SetSpec::small(7, 5);
        board.image = (800, 600);
        board.look.noise = 2.5;
        assert_eq!(
            read("board --out b --count 7 --seed 5 --width 800 --noise 2.5").unwrap(),
            Command::Board {
                out: "b".into(),
                spec: board
            }
        );
        assert_eq!(
            read("fixtures --check").unwrap(),
            Command::Fixtures { check: true }
        );
        let options = |quick, seeds, out: &str| {
            Command::SynthEval(Options {
                quick,
                seeds,
                out: out.into(),
            })
        };
        assert_eq!(
            read("synth-eval").unwrap(),
            options(false, None, "out/synth-eval")
        );
        assert_eq!(
            read("synth-eval --quick --seeds 4 --out r").unwrap(),
            options(true, Some(4), "r")
        );
        assert_eq!(read("tidy").unwrap(), Command::Tidy);
        assert_eq!(read("ci --help").unwrap(), Command::Help);
    }

    #[test]
    fn wrong_lines_say_what_is_wrong() {
        for (line, word) in [
            ("", "command"),
            ("paint", "paint"),
            ("scene", "--out"),
            ("scene --out x --kind cave", "cave"),
            ("scene --out x --frames 1", "1"),
            ("scene --out x --seed -3", "-3"),
            ("scene --out x --noise-px", "--noise-px"),
            ("board", "--out"),
            ("board --out b --count 0", "--count"),
            ("board --out b --width 20", "--width"),
            ("board --out b --noise nan", "--noise"),
            ("tidy up", "up"),
            ("fixtures --all", "--all"),
            ("synth-eval --seeds 0", "--seeds"),
            ("synth-eval --fast", "--fast"),
        ] {
            let message = read(line).unwrap_err().to_string();
            assert!(
                message.contains(word) && !message.contains('\n'),
                "{line}: {message}"
            );
        }
    }
}
