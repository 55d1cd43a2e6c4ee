//! The command line of `synth-eval`.

use lexopt::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;
use synth_eval::Options;

/// The text of `--help`.
pub(crate) const HELP: &str = "\
synth-eval [OPTIONS]
      compare the filters on rendered scenes and recorded sequences; results and tables go to DIR
  --quick               3 seeds and the five most telling estimators (without: 8 seeds, all)
  --scene NAME          a rendered scene, see below; may be repeated (wall)
  --points              keypoints of the scenes are simulated, without images: hundreds of seeds in minutes
  --sequence SEQ        a recorded sequence with a reference path; may be repeated
  --seeds N|A-B         seeds 1 to N, or A to B
  --frames N            frames of the rendered scenes
  --method M:PARTICLES  dead-reckoning, conventional:100, paper:50, exact:50; may be repeated
  --ablations           the exact filter without one of its parts at a time (also: --method no-evolution:50, ...)
  --default-config      the shipped configuration (without: it is told the exact odometry noise of rendered scenes)
  --config FILE         this configuration
  --no-batch            without the batch solution over the associations of each run, the limit of the tables
  --shard I/N           do the I-th of N parts
  --compare OLD.jsonl   print what got worse beyond its bootstrap interval; exit code 3 if anything did
  --out DIR             the folder (out/synth-eval)

synth-eval merge FILE.jsonl... [--compare OLD.jsonl] [--out DIR]
      put the results of shards together

synth-eval figures [--quick] [--points] [--seeds N] [--out DIR]
      the paper's figures 2, 3, 6 to 9 as SVG and on one page, figures.html
";

/// A parsed command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Command {
    /// Print [`HELP`].
    Help,
    /// Run a study.
    Run(Box<Options>),
    /// Merge results.
    Merge {
        /// Files of JSON lines.
        files: Vec<PathBuf>,
        /// An earlier study.
        compare: Option<PathBuf>,
        /// Folder of the results.
        out: PathBuf,
    },
    /// Draw the figures.
    Figures(Box<Options>),
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
        batch: true,
        out: PathBuf::from("out/synth-eval"),
        ..Options::default()
    };
    let (mut name, mut files) = (None, Vec::new());
    while let Some(argument) = parser.next()? {
        match argument {
            Long("quick") => options.quick = true,
            Long("scene") => options.scenes.push(parser.value()?.string()?),
            Long("points") => options.points = true,
            Long("sequence") => options.sequences.push(parser.value()?.into()),
            Long("seeds") => options.seeds = Some(seeds(&parser.value()?.string()?)?),
            Long("frames") => options.frames = Some(parser.value()?.parse()?),
            Long("method") => options.methods.push(parser.value()?.string()?),
            Long("ablations") => options.ablations = true,
            Long("default-config") => options.default_config = true,
            Long("no-batch") => options.batch = false,
            Long("config") => options.config = Some(parser.value()?.into()),
            Long("shard") => options.shard = Some(shard(&parser.value()?.string()?)?),
            Long("compare") => options.compare = Some(parser.value()?.into()),
            Long("out") => options.out = PathBuf::from(parser.value()?),
            Long("help") | Short('h') => return Ok(Command::Help),
            Value(value) if name.is_none() => name = Some(value.string()?),
            Value(value) if name.as_deref() == Some("merge") => files.push(value.into()),
            other => return Err(other.unexpected()),
        }
    }
    if options.out.as_os_str().is_empty() {
        return Err("--out must not be empty".into());
    }
    if options.default_config && options.config.is_some() {
        return Err("--default-config and --config exclude one another".into());
    }
    match name.as_deref() {
        None => Ok(Command::Run(Box::new(options))),
        Some("figures") => Ok(Command::Figures(Box::new(options))),
        Some("merge") if files.is_empty() => Err("merge needs files of results".into()),
        Some("merge") => Ok(Command::Merge {
            files,
            compare: options.compare,
            out: options.out,
        }),
        Some(other) => {
            Err(format!("no command `{other}`: merge or figures, or flags alone").into())
        }
    }
}

/// `N` or `A-B`.
fn seeds(text: &str) -> Result<(u64, u64), lexopt::Error> {
    let number = |text: &str| {
        text.parse::<u64>()
            .map_err(|error| format!("--seeds takes N or A-B, not `{text}`: {error}"))
    };
    Ok(match text.split_once('-') {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (1, number(text)?),
    })
}

/// `I/N`.
fn shard(text: &str) -> Result<(u32, u32), lexopt::Error> {
    text.split_once('/')
        .and_then(|(part, parts)| Some((part.parse().ok()?, parts.parse().ok()?)))
        .ok_or_else(|| format!("--shard takes I/N, not `{text}`").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Command, lexopt::Error> {
        parse(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn every_flag_reaches_the_options() {
        let default = Options {
            batch: true,
            out: "out/synth-eval".into(),
            ..Options::default()
        };
        assert_eq!(read("").unwrap(), Command::Run(Box::new(default)));
        let line = "--quick --scene wall --scene room --points --sequence a/b --seeds 4-9 --frames 12 --method exact:5 --ablations \
                    --default-config --no-batch --shard 2/3 --compare old.jsonl --out r";
        let options = Options {
            quick: true,
            scenes: vec!["wall".into(), "room".into()],
            points: true,
            sequences: vec!["a/b".into()],
            frames: Some(12),
            seeds: Some((4, 9)),
            methods: vec!["exact:5".into()],
            ablations: true,
            default_config: true,
            config: None,
            batch: false,
            shard: Some((2, 3)),
            out: "r".into(),
            compare: Some("old.jsonl".into()),
        };
        assert_eq!(read(line).unwrap(), Command::Run(Box::new(options)));
        assert_eq!(
            read("merge a b --out r").unwrap(),
            Command::Merge {
                files: vec!["a".into(), "b".into()],
                compare: None,
                out: "r".into()
            }
        );
        let Command::Figures(options) = read("figures --seeds 3").unwrap() else {
            panic!("not figures");
        };
        assert_eq!(options.seeds, Some((1, 3)));
        assert_eq!(read("--quick --help").unwrap(), Command::Help);
    }

    #[test]
    fn wrong_lines_say_what_is_wrong() {
        for (line, word) in [
            ("--seeds many", "many"),
            ("--seeds 3-", "--seeds"),
            ("--shard 3", "--shard"),
            ("--fast", "--fast"),
            ("quickly", "quickly"),
            ("merge", "files"),
            ("figures more", "more"),
            ("--config a --default-config", "--config"),
        ] {
            let message = read(line).unwrap_err().to_string();
            assert!(
                message.contains(word) && !message.contains('\n'),
                "{line}: {message}"
            );
        }
    }
}
