//! The gate: formatting, clippy, tests, doctests, documentation, tidy.
//!
//! Every step runs even when an earlier one failed, each with its time; the
//! error names the steps that failed.

use crate::{programs, tidy};
use anyhow::ensure;
use std::path::Path;
use std::time::Instant;
use xshell::{Shell, cmd};

/// The seed of all property tests here: the gate says the same of the same tree each time. `cargo test` draws new cases.
const PROPERTY_SEED: &str = "2006";

/// Runs the whole gate in the workspace at `root`.
///
/// # Errors
/// The names of the steps that failed.
pub(crate) fn run(root: &Path) -> anyhow::Result<()> {
    let shell = Shell::new()?;
    shell.change_dir(root);
    let cargo = programs::cargo();
    let steps: [(&str, &dyn Fn() -> anyhow::Result<()>); 6] = [
        ("fmt", &|| {
            Ok(cmd!(shell, "{cargo} fmt --all -- --check").run()?)
        }),
        ("clippy", &|| {
            Ok(cmd!(
                shell,
                "{cargo} clippy --locked --workspace --all-targets -- -D warnings"
            )
            .run()?)
        }),
        // Examples are compiled by clippy; linking each of them here would prove nothing more.
        ("test", &|| {
            Ok(cmd!(
                shell,
                "{cargo} test --locked --workspace --lib --bins --tests"
            )
            .env("PROPTEST_RNG_SEED", PROPERTY_SEED)
            .run()?)
        }),
        ("doctest", &|| {
            Ok(cmd!(shell, "{cargo} test --locked --workspace --doc").run()?)
        }),
        ("doc", &|| {
            let doc = cmd!(shell, "{cargo} doc --locked --workspace --no-deps");
            Ok(doc.env("RUSTDOCFLAGS", "-D warnings").run()?)
        }),
        ("tidy", &|| tidy::run(root)),
    ];
    let (mut summary, mut failed) = (String::new(), Vec::new());
    for (name, step) in steps {
        println!("== {name}");
        let start = Instant::now();
        let outcome = step();
        let verdict = if outcome.is_ok() { "ok" } else { "FAILED" };
        summary += &format!(
            "{name:<8}{:>8.1} s  {verdict}\n",
            start.elapsed().as_secs_f64()
        );
        if let Err(error) = outcome {
            println!("{error:#}");
            failed.push(name);
        }
    }
    print!("{summary}");
    ensure!(failed.is_empty(), "failed: {}", failed.join(", "));
    Ok(())
}
