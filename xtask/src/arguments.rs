//! The command line of `cargo xtask`: every command in one place.
//!
//! The commands that belong to a program of the workspace take their flags to it unread.

use crate::package;
use lexopt::prelude::*;
use std::ffi::OsString;

/// The text of `--help`.
pub(crate) const HELP: &str = "\
cargo xtask <command>

scene, board   render a sequence or pictures of a checkerboard (the program wall-scenes)
synth-eval     compare the filters on scenes and sequences (the program synth-eval)
fixtures [--check]
               rewrite fixtures/wall and fixtures/board, or verify that they are what would be written
tidy [--stats] check the rules of the tree, or print lines, long files and test binaries of every crate
package [--out DIR] [--repository URL] [--verify] [--check-names]
               package every publishable crate under the names of the family (CONTRIBUTING.md)
ci             formatting, clippy, tests, documentation, tidy

cargo xtask scene --help and the like list the flags of the programs.
";

/// The names that are commands, for messages.
const COMMANDS: &str = "scene, board, fixtures, synth-eval, tidy, package or ci";

/// A parsed command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Command {
    /// Print [`HELP`].
    Help,
    /// Start a program of the workspace.
    Program {
        /// The package, which has a binary of the same name.
        package: &'static str,
        /// Its arguments.
        arguments: Vec<OsString>,
    },
    /// Rewrite the fixtures, or verify them.
    Fixtures {
        /// Verify only.
        check: bool,
    },
    /// Check the rules of the tree, or print its figures.
    Tidy {
        /// Print the figures only.
        stats: bool,
    },
    /// Package the publishable crates.
    Package(package::Options),
    /// The whole gate.
    Ci,
}

/// Reads a command line without the program's name.
///
/// # Errors
/// Anything unknown or out of place, in one sentence.
pub(crate) fn parse(
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<Command, lexopt::Error> {
    let mut parser = lexopt::Parser::from_args(arguments);
    let name = match parser.next()? {
        None => return Err(format!("a command is required: {COMMANDS}").into()),
        Some(Long("help") | Short('h')) => return Ok(Command::Help),
        Some(Value(name)) => name.string()?,
        Some(other) => return Err(other.unexpected()),
    };
    match name.as_str() {
        // These two are commands of their program too.
        "scene" | "board" => program("wall-scenes", Some(name.clone()), &mut parser),
        "synth-eval" => program("synth-eval", None, &mut parser),
        "fixtures" => Ok(match flag(&mut parser, "check")? {
            None => Command::Help,
            Some(check) => Command::Fixtures { check },
        }),
        "tidy" => Ok(match flag(&mut parser, "stats")? {
            None => Command::Help,
            Some(stats) => Command::Tidy { stats },
        }),
        "package" => package(&mut parser),
        "ci" => match parser.next()? {
            None => Ok(Command::Ci),
            Some(Long("help") | Short('h')) => Ok(Command::Help),
            Some(other) => Err(other.unexpected()),
        },
        "help" => Ok(Command::Help),
        other => Err(format!("no command `{other}`: use {COMMANDS}").into()),
    }
}

/// A program with the rest of the line as its arguments.
fn program(
    package: &'static str,
    first: Option<String>,
    parser: &mut lexopt::Parser,
) -> Result<Command, lexopt::Error> {
    let mut arguments: Vec<OsString> = first.map(OsString::from).into_iter().collect();
    arguments.extend(parser.raw_args()?);
    Ok(Command::Program { package, arguments })
}

/// The flags of `package`.
fn package(parser: &mut lexopt::Parser) -> Result<Command, lexopt::Error> {
    let mut options = package::Options::default();
    while let Some(argument) = parser.next()? {
        match argument {
            Long("out") => options.out = Some(parser.value()?.into()),
            Long("repository") => {
                let address = parser.value()?.string()?;
                options.repository = Some(address.trim_end_matches('/').to_owned());
            }
            Long("verify") => options.verify = true,
            Long("check-names") => options.check_names = true,
            Long("help") | Short('h') => return Ok(Command::Help),
            other => return Err(other.unexpected()),
        }
    }
    Ok(Command::Package(options))
}

/// Whether the only flag allowed is given; `None` when help is asked for.
fn flag(parser: &mut lexopt::Parser, allowed: &str) -> Result<Option<bool>, lexopt::Error> {
    let mut given = false;
    while let Some(argument) = parser.next()? {
        match argument {
            Long(name) if name == allowed => given = true,
            Long("help") | Short('h') => return Ok(None),
            other => return Err(other.unexpected()),
        }
    }
    Ok(Some(given))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Command, lexopt::Error> {
        parse(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn programs_get_their_arguments_unread() {
        let program = |package, arguments: &[&str]| Command::Program {
            package,
            arguments: arguments.iter().map(OsString::from).collect(),
        };
        assert_eq!(
            read("scene --out a/b --kind=room --seed -3").unwrap(),
            program(
                "wall-scenes",
                &["scene", "--out", "a/b", "--kind=room", "--seed", "-3"]
            )
        );
        assert_eq!(
            read("board --help").unwrap(),
            program("wall-scenes", &["board", "--help"])
        );
        assert_eq!(
            read("synth-eval --quick --seeds 4").unwrap(),
            program("synth-eval", &["--quick", "--seeds", "4"])
        );
    }

    #[test]
    fn own_commands_have_their_own_flags() {
        for (line, command) in [
            ("fixtures", Command::Fixtures { check: false }),
            ("fixtures --check", Command::Fixtures { check: true }),
            ("tidy", Command::Tidy { stats: false }),
            ("tidy --stats", Command::Tidy { stats: true }),
            ("ci", Command::Ci),
            ("ci --help", Command::Help),
            ("--help", Command::Help),
        ] {
            assert_eq!(read(line).unwrap(), command, "{line}");
        }
    }

    #[test]
    fn wrong_lines_say_what_is_wrong() {
        for (line, word) in [
            ("", "command"),
            ("paint", "paint"),
            ("--quick", "--quick"),
            ("tidy up", "up"),
            ("tidy --check", "--check"),
            ("fixtures --all", "--all"),
            ("ci now", "now"),
        ] {
            let message = read(line).unwrap_err().to_string();
            assert!(
                message.contains(word) && !message.contains('\n'),
                "{line}: {message}"
            );
        }
    }
}
