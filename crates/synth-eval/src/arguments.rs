//! The command line of `synth-eval`.

use lexopt::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use synth_eval::Options;

/// The text of `--help`.
pub(crate) const HELP: &str = "\
synth-eval [--quick] [--seeds N] [--out DIR]
      compare the filters on N rendered walls; results, table and figures go to DIR (out/synth-eval)
";

/// A parsed command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Command {
    /// Print [`HELP`].
    Help,
    /// Run the comparison.
    Run(Options),
}

/// Reads a command line without the program's name.
///
/// # Errors
/// Anything unknown, missing or out of place, in one sentence.
pub(crate) fn parse(
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<Command, lexopt::Error> {
    let mut parser = lexopt::Parser::from_args(arguments);
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
            other => return Err(other.unexpected()),
        }
    }
    options.seed_count().map_err(|error| error.to_string())?;
    if options.out.as_os_str().is_empty() {
        return Err("--out must not be empty".into());
    }
    Ok(Command::Run(options))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Command, lexopt::Error> {
        parse(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn every_flag_reaches_the_options() {
        let options = |quick, seeds, out: &str| {
            Command::Run(Options {
                quick,
                seeds,
                out: out.into(),
            })
        };
        assert_eq!(read("").unwrap(), options(false, None, "out/synth-eval"));
        assert_eq!(
            read("--quick --seeds 4 --out r").unwrap(),
            options(true, Some(4), "r")
        );
        assert_eq!(read("--quick --help").unwrap(), Command::Help);
    }

    #[test]
    fn wrong_lines_say_what_is_wrong() {
        for (line, word) in [
            ("--seeds 0", "--seeds"),
            ("--seeds many", "many"),
            ("--fast", "--fast"),
            ("quickly", "quickly"),
        ] {
            let message = read(line).unwrap_err().to_string();
            assert!(
                message.contains(word) && !message.contains('\n'),
                "{line}: {message}"
            );
        }
    }
}
