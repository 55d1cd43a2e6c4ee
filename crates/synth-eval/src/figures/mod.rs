//! The paper's figures on one page.
//!
//! Fig. 2 (keypoints at two distances), 3 (matches), 6 and 7 (maps of the conventional and of the exact filter), 8 (errors
//! against the number of particles, with bootstrap bands over the seeds) and 9 (a room from above), each as an SVG file
//! and all of them in `figures.html`, which stands alone.

mod grid;
mod maps;
mod particles;
mod pictures;

use crate::Options;
use crate::estimator::Estimator;
use crate::recording::Recording;
use crate::row::read_rows;
use crate::settings::Settings;
use crate::study::{Outcome, run, write_file};
use slam_pipeline::config::Config;
use std::fmt::Write as _;
use wall_scenes::SceneSpec;

/// Numbers of particles of Fig. 8.
const PARTICLES: [u32; 7] = [10, 20, 50, 100, 200, 500, 1000];
/// Those of a quick run.
const QUICK_PARTICLES: [u32; 3] = [10, 50, 100];
/// Seeds of Fig. 8.
const SEEDS: (u64, u64) = (1, 10);
/// Seed of the pictures and maps.
const SHOWN_SEED: u64 = 1;

const STYLE: &str = "body{margin:0;background:#f4f6f9;color:#16202c;font:15px/1.5 system-ui,sans-serif}\
main{max-width:1300px;margin:0 auto;padding:32px 24px}h1{font-size:30px;margin:0 0 4px}\
figure{margin:24px 0;padding:16px 18px;background:#fff;border:1px solid #e1e6ed;border-radius:12px}\
figure svg{max-width:100%;height:auto;display:block;margin:0 auto}figcaption{color:#5c6878;margin-top:8px}\
figcaption b{color:#16202c}p{color:#5c6878;margin:0}";

/// One figure of the page.
struct Figure {
    file: &'static str,
    title: &'static str,
    caption: String,
    svg: String,
}

/// Draws the figures into the output folder, beside the results that Fig. 8 is made from, and returns their table.
///
/// # Errors
/// As [`run`].
pub fn figures(options: &Options, progress: &(dyn Fn(&str) + Sync)) -> anyhow::Result<Outcome> {
    let numbers: &[u32] = if options.quick {
        &QUICK_PARTICLES
    } else {
        &PARTICLES
    };
    let mut study = options.clone();
    study.batch = false;
    study.seeds = Some(options.seeds.unwrap_or(SEEDS));
    study.methods = vec!["dead-reckoning".into()];
    for family in ["conventional", "paper", "exact"] {
        study
            .methods
            .extend(numbers.iter().map(|number| format!("{family}:{number}")));
    }
    let outcome = run(&study, progress)?;
    let rows = read_rows(&options.out.join("results.jsonl"))?;

    progress("figures 2 and 3");
    let settings = Settings::ExactNoise;
    let config = Config::default();
    let seeds = study.seeds.map_or(0, |(first, last)| last - first + 1);
    let mut figures = vec![
        Figure {
            file: "figure2_keypoints.svg",
            title: "Figure 2. Keypoints at two distances",
            caption: "The nearest and the farthest view of a room; the 200 strongest keypoints as circles of three times their scale, with the orientation."
                .into(),
            svg: pictures::two_distances(SHOWN_SEED)?,
        },
        Figure {
            file: "figure3_matches.svg",
            title: "Figure 3. Matches",
            caption: "Mutual matches of two images of the wall; red where the two keypoints see surface points more than 3 cm apart."
                .into(),
            svg: pictures::matches(SHOWN_SEED)?,
        },
    ];
    progress("figures 6 and 7");
    let wall = Recording::rendered("wall", SceneSpec::wall(SHOWN_SEED), &config)?;
    let draw = |names: [&str; 2], title: &str| -> anyhow::Result<String> {
        let estimators = names
            .iter()
            .map(|name| Estimator::parse(name))
            .collect::<anyhow::Result<Vec<_>>>()?;
        maps::maps(&wall, &estimators, &settings, SHOWN_SEED, maps::WALL, title)
    };
    figures.push(Figure {
        file: "figure6_conventional.svg",
        title: "Figure 6. Maps of the conventional filter",
        caption: "100 and 500 particles on the wall, from above; S is the start, E the end.".into(),
        svg: draw(
            ["conventional:100", "conventional:500"],
            "Conventional filter",
        )?,
    });
    figures.push(Figure {
        file: "figure7_exact.svg",
        title: "Figure 7. Maps of the exact filter",
        caption: "50 and 100 particles on the same wall.".into(),
        svg: draw(["exact:50", "exact:100"], "Exact filter")?,
    });
    figures.push(Figure {
        file: "figure8_particles.svg",
        title: "Figure 8. Errors against the number of particles",
        caption: format!(
            "Mean over {seeds} seeds{}, the band is its 95 % bootstrap interval. No alignment.",
            if options.points {
                " of simulated points"
            } else {
                " of rendered walls"
            }
        ),
        svg: particles::particles(&rows),
    });
    progress("figure 9");
    let room = Recording::rendered("room", SceneSpec::room(SHOWN_SEED), &config)?;
    figures.push(Figure {
        file: "figure9_room.svg",
        title: "Figure 9. A room from above",
        caption:
            "One lap of a room with four walls, 186 images; a conventional and an exact filter."
                .into(),
        svg: maps::maps(
            &room,
            &[
                Estimator::parse("conventional:100")?,
                Estimator::parse("exact:50")?,
            ],
            &settings,
            SHOWN_SEED,
            maps::ROOM,
            "Room from above",
        )?,
    });
    for figure in &figures {
        write_file(&options.out.join(figure.file), &figure.svg)?;
    }
    write_file(&options.out.join("figures.html"), &page(&figures))?;
    Ok(outcome)
}

fn page(figures: &[Figure]) -> String {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>The paper's figures</title>\n\
         <style>{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>The paper’s figures</h1>\n\
         <p>Made anew on rendered scenes, numbered as in the paper.</p>\n"
    );
    for figure in figures {
        let _ = write!(
            page,
            "<figure>\n{}<figcaption><b>{}.</b> {}</figcaption>\n</figure>\n",
            figure.svg, figure.title, figure.caption
        );
    }
    page.push_str("</main>\n</body>\n</html>\n");
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_holds_every_figure_with_its_caption() {
        let figure = |title, caption: &str| Figure {
            file: "a.svg",
            title,
            caption: caption.into(),
            svg: "<svg></svg>\n".into(),
        };
        let text = page(&[figure("Figure 2", "two"), figure("Figure 3", "three")]);
        assert_eq!(text.matches("<svg>").count(), 2);
        assert!(text.contains("<b>Figure 3.</b> three"));
        assert!(text.starts_with("<!DOCTYPE html>") && text.ends_with("</html>\n"));
    }
}
