//! From corners to grids: neighbours along common edges, then whole coordinates.
//!
//! Problem: which corners belong together, and where in the board each one lies, without a model of lens or pose.
//!
//! Two corners are neighbours when one edge joins them: each lies in the direction of one of the other's edges, the
//! edges that cross this one are nearly parallel, the
//! square on one side of that edge is bright for both, and along the edge the image is bright on that side and dark on
//! the other ([`edge_between`]). A link holds when it is the nearest choice of both. Only neighbours are ever compared,
//! over one square, so a lens that bends the board by many pixels changes nothing (the neighbourhood argument of
//! Geiger, Moosmann, Car and Schuster, ICRA 2012, whose energy over triples is replaced by the test of the edges).
//!
//! Steps: links; coordinates by walking over the links from every corner not yet visited, turning with the corners'
//! own edges (0, 1, 2, 3 are +u, +v, -u, -v in the sense of growing angles, so (u, v) is never mirrored); corners out of line
//! taken out ([`prune`]); holes and rims filled by looking again, less strictly, where the neighbours say a corner must be.
//!
//! Degenerate: a walk that reaches a corner with two different coordinates keeps the first; two corners at one
//! coordinate likewise. Both leave a hole, which the caller reports.

use std::collections::{BTreeMap, VecDeque};

use super::plane::Plane;
use super::saddle::{is_maximum, saddle_point};
use super::star::{Star, star, turn};

/// Whole coordinates of a corner in its grid.
pub(super) type Cell = (i32, i32);

/// Corners by coordinate: (index of the star, turn from its edges to grid directions).
pub(super) type Grid = BTreeMap<Cell, (usize, usize)>;

/// Grid directions in the order of growing angles.
pub(super) const DIRECTIONS: [Cell; 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Number of nearby stars that are tried as neighbours of each; between a corner and its neighbours lies only noise.
const NEAREST: usize = 120;
/// Largest angle between an edge and the line to the neighbour it leads to, radians (20 degrees: the ring's error
/// plus what lens and perspective bend over one square).
const DIRECTION_TOLERANCE: f64 = 0.35;
/// Largest angle between the edges of two neighbours that cross the one between them, radians (22 degrees): nearly parallel
/// over one square, while the saddles between small squares are turned by half a right angle.
const CROSSING_TOLERANCE: f64 = 0.38;
/// Share of the stronger corner's contrast that must show across the edge between two: light does not change by more
/// over one square, and noise beside a board has far less.
const EDGE_SHARE: f64 = 0.3;
/// How far from its prediction a missing corner is looked for, in squares.
const SEARCH_SHARE: f64 = 0.3;
/// Response that suffices where a corner is expected, grey levels a squared pixel.
const EXPECTED_RESPONSE: f32 = 0.7;
/// Largest second difference of three corners in a row, as a share of the shorter step.
const BEND_SHARE: f64 = 0.6;
/// Largest coordinate; more is a texture, not a board.
const FURTHEST: i32 = 200;

/// Neighbour of every star along each of its edges: (star, its edge that leads back).
type Links = Vec<[Option<(usize, usize)>; 4]>;

/// Every grid of at least four corners, largest first.
pub(super) fn grids(blurred: &Plane, stars: &[Star]) -> Vec<Grid> {
    let links = mutual(&choices(blurred, stars));
    let mut visited = vec![false; stars.len()];
    let mut grids = Vec::new();
    for start in 0..stars.len() {
        if !visited[start] {
            let grid = walk(&links, start, &mut visited);
            if grid.len() >= 4 {
                grids.push(grid);
            }
        }
    }
    grids.sort_by_key(|grid| std::cmp::Reverse(grid.len()));
    grids
}

/// For every star and edge the nearest star that the edge leads to.
fn choices(blurred: &Plane, stars: &[Star]) -> Links {
    let mut links = vec![[None; 4]; stars.len()];
    let mut by_distance: Vec<(f64, usize)> = Vec::with_capacity(stars.len());
    for (index, from) in stars.iter().enumerate() {
        by_distance.clear();
        by_distance.extend(stars.iter().enumerate().map(|(other, to)| {
            let [x, y] = difference(to.position, from.position);
            (x * x + y * y, other)
        }));
        let order = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if by_distance.len() > NEAREST {
            by_distance.select_nth_unstable_by(NEAREST, order);
            by_distance.truncate(NEAREST);
        }
        by_distance.sort_unstable_by(order);
        let near = by_distance.iter().filter_map(|&(_, other)| {
            let offset = difference(stars[other].position, from.position);
            let (ray, off) = from.nearest_ray(offset[1].atan2(offset[0]));
            let towards = other != index && off <= DIRECTION_TOLERANCE.min(from.half_gap(ray));
            towards.then_some((other, ray))
        });
        for (other, ray) in near {
            if links[index][ray].is_none()
                && let Some(back) = edge_between(blurred, from, ray, &stars[other])
            {
                links[index][ray] = Some((other, back));
            }
            if links[index].iter().all(Option::is_some) {
                break;
            }
        }
    }
    links
}

/// The edge of `to` that leads back to `from` when its edge `ray` joins them.
fn edge_between(blurred: &Plane, from: &Star, ray: usize, to: &Star) -> Option<usize> {
    let offset = difference(to.position, from.position);
    let direction = offset[1].atan2(offset[0]);
    let (back, off) = to.nearest_ray(direction + std::f64::consts::PI);
    if off > DIRECTION_TOLERANCE.min(to.half_gap(back))
        || from.bright_after(ray) == to.bright_after(back)
    {
        return None;
    }
    let crossing = |ray_of_from: usize, ray_of_to: usize| {
        turn(from.rays[ray_of_from % 4] - to.rays[ray_of_to % 4]).abs() <= CROSSING_TOLERANCE
    };
    if !crossing(ray + 1, back + 3) || !crossing(ray + 3, back + 1) {
        return None;
    }
    let length = offset[0].hypot(offset[1]);
    // Growing angles lead from (1, 0) to (0, 1): that side of the edge is the square after `ray`.
    let across = [-offset[1] / length, offset[0] / length];
    let aside = (0.2 * length).clamp(1.5, 4.0);
    let sign = if from.bright_after(ray) { 1.0 } else { -1.0 };
    let needed = EDGE_SHARE * from.contrast.max(to.contrast);
    for share in [0.3, 0.5, 0.7] {
        let on = [0, 1].map(|axis| from.position[axis] + share * offset[axis]);
        let value = |side: f64| {
            blurred
                .sample(on[0] + side * across[0], on[1] + side * across[1])
                .map(f64::from)
        };
        if sign * (value(aside)? - value(-aside)?) < needed {
            return None;
        }
    }
    Some(back)
}

/// Links that both ends chose.
fn mutual(links: &Links) -> Links {
    let mut kept = links.clone();
    for (index, choices) in links.iter().enumerate() {
        for (ray, choice) in choices.iter().enumerate() {
            if let Some((other, back)) = *choice
                && links[other][back] != Some((index, ray))
            {
                kept[index][ray] = None;
            }
        }
    }
    kept
}

fn walk(links: &Links, start: usize, visited: &mut [bool]) -> Grid {
    let mut grid = Grid::new();
    grid.insert((0, 0), (start, 0));
    visited[start] = true;
    let mut open = VecDeque::from([((0, 0), start, 0)]);
    while let Some((cell, star, turned)) = open.pop_front() {
        for ray in 0..4 {
            let Some((other, back)) = links[star][ray] else {
                continue;
            };
            let direction = (ray + turned) % 4;
            let next = beside(cell, direction, 1);
            if visited[other] || grid.contains_key(&next) || far(next) {
                continue;
            }
            visited[other] = true;
            let other_turned = (direction + 2 + 4 - back) % 4;
            grid.insert(next, (other, other_turned));
            open.push_back((next, other, other_turned));
        }
    }
    grid
}

/// Takes out corners that do not lie in line with their neighbours, the worst first.
///
/// A false corner breaks [`in_line`] in every row of three it is part of, its neighbours only in those they share with
/// it: the corner goes whose rows are broken to the largest share, then in the largest number.
pub(super) fn prune(stars: &[Star], grid: &mut Grid) {
    loop {
        let mut rows: BTreeMap<Cell, (usize, usize)> = BTreeMap::new();
        for &cell in grid.keys() {
            for direction in 0..2 {
                let trio = [0, 1, 2].map(|steps| beside(cell, direction, steps));
                let places = trio.map(|place| Some(stars[grid.get(&place)?.0].position));
                if let [Some(a), Some(b), Some(c)] = places {
                    for place in trio {
                        let entry = rows.entry(place).or_default();
                        *entry = (entry.0 + usize::from(!in_line(a, b, c)), entry.1 + 1);
                    }
                }
            }
        }
        let share = |entry: &(usize, usize)| entry.0 as f64 / entry.1 as f64;
        let worst = rows
            .iter()
            .filter(|(_, entry)| entry.0 > 0)
            .max_by(|a, b| share(a.1).total_cmp(&share(b.1)).then(a.1.0.cmp(&b.1.0)));
        match worst {
            Some((&cell, _)) => grid.remove(&cell),
            None => return,
        };
    }
}

/// Whether the second difference of three corners in a row is at most [`BEND_SHARE`] of the shorter step, as it is whatever
/// perspective and lens do.
fn in_line(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> bool {
    let bend = (a[0] - 2.0 * b[0] + c[0]).hypot(a[1] - 2.0 * b[1] + c[1]);
    bend <= BEND_SHARE * distance(a, b).min(distance(b, c))
}

/// Whether a corner at `position` would be in line with all rows of `cell`.
fn lines_up(stars: &[Star], grid: &Grid, cell: Cell, position: [f64; 2]) -> bool {
    let place = |direction: usize, steps: i32| {
        Some(stars[grid.get(&beside(cell, direction, steps))?.0].position)
    };
    (0..4).all(|direction| {
        let ahead = place(direction, 1);
        let further = ahead.zip(place(direction, 2));
        let across = ahead.zip(place(direction + 2, 1));
        further.is_none_or(|(one, two)| in_line(position, one, two))
            && across.is_none_or(|(one, other)| in_line(one, position, other))
    })
}

/// Adds corners beside those of the grid until there is no more to find; new stars go to the end of `stars`.
pub(super) fn complete(blurred: &Plane, response: &Plane, stars: &mut Vec<Star>, grid: &mut Grid) {
    // Every pass adds a corner or ends; a board has a few thousand at most.
    loop {
        let mut added = false;
        let empty: std::collections::BTreeSet<Cell> = grid
            .keys()
            .flat_map(|&cell| DIRECTIONS.map(|step| (cell.0 + step.0, cell.1 + step.1)))
            .filter(|cell| !grid.contains_key(cell) && !far(*cell))
            .collect();
        for cell in empty {
            let Some((expected, spacing)) = predicted(stars, grid, cell) else {
                continue;
            };
            if let Some(entry) = look(blurred, response, stars, grid, cell, expected, spacing) {
                grid.insert(cell, entry);
                added = true;
            }
        }
        if !added {
            return;
        }
    }
}

/// Where a corner must be by its neighbours, and the length of a square there, pixels.
fn predicted(stars: &[Star], grid: &Grid, cell: Cell) -> Option<([f64; 2], f64)> {
    let place = |direction: usize, steps: i32| {
        grid.get(&beside(cell, direction, steps))
            .map(|&(star, _)| stars[star].position)
    };
    let mut guesses: Vec<([f64; 2], f64)> = Vec::new();
    for direction in 0..2 {
        if let (Some(a), Some(b)) = (place(direction, 1), place(direction + 2, 1)) {
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            guesses.push((middle, 0.5 * distance(a, b)));
        }
    }
    if guesses.is_empty() {
        for direction in 0..4 {
            let (Some(one), Some(two)) = (place(direction, 1), place(direction, 2)) else {
                continue;
            };
            // A third corner tells how the squares grow or shrink.
            let position = [0, 1].map(|axis| match place(direction, 3) {
                Some(three) => 3.0 * (one[axis] - two[axis]) + three[axis],
                None => 2.0 * one[axis] - two[axis],
            });
            guesses.push((position, distance(one, two)));
        }
    }
    let spacing = guesses.iter().map(|guess| guess.1).reduce(f64::min)?;
    let mean = [0, 1]
        .map(|axis| guesses.iter().map(|guess| guess.0[axis]).sum::<f64>() / guesses.len() as f64);
    Some((mean, spacing))
}

/// The corner near `expected` that fits the neighbours of `cell`, with its turn.
fn look(
    blurred: &Plane,
    response: &Plane,
    stars: &mut Vec<Star>,
    grid: &Grid,
    cell: Cell,
    expected: [f64; 2],
    spacing: f64,
) -> Option<(usize, usize)> {
    let reach = SEARCH_SHARE * spacing;
    let mut near: Vec<(f64, usize)> = stars
        .iter()
        .enumerate()
        .map(|(index, star)| (distance(star.position, expected), index))
        .filter(|entry| entry.0 <= reach)
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let known = near
        .iter()
        .find_map(|&(_, index)| Some((index, fits(blurred, stars, grid, cell, &stars[index])?)));
    if let Some((index, _)) = known
        && grid.values().any(|entry| entry.0 == index)
    {
        return None;
    }
    if known.is_some() {
        return known;
    }
    // Nothing among the strong ones: the best weak maximum.
    let bounds = |centre: f64, side: usize| {
        let low = (centre - reach).ceil().max(4.0);
        let high = (centre + reach).floor().min(side as f64 - 5.0);
        (low <= high).then_some(low as usize..=high as usize)
    };
    let columns = bounds(expected[0], response.width)?;
    let mut weak: Vec<(f32, usize, usize)> = Vec::new();
    for y in bounds(expected[1], response.height)? {
        for x in columns.clone() {
            let value = response.at(x, y);
            if value >= EXPECTED_RESPONSE && is_maximum(response, x, y) {
                weak.push((value, x, y));
            }
        }
    }
    weak.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.2, a.1).cmp(&(b.2, b.1))));
    weak.iter().find_map(|&(_, x, y)| {
        let found = star(blurred, saddle_point(blurred, x, y))?;
        let turned = fits(blurred, stars, grid, cell, &found)?;
        stars.push(found);
        Some((stars.len() - 1, turned))
    })
}

/// The turn of `candidate` when edges join it to every neighbour of `cell` that the grid has.
fn fits(
    blurred: &Plane,
    stars: &[Star],
    grid: &Grid,
    cell: Cell,
    candidate: &Star,
) -> Option<usize> {
    if !lines_up(stars, grid, cell, candidate.position) {
        return None;
    }
    let mut agreed = None;
    for direction in 0..4 {
        let Some(&(other, other_turned)) = grid.get(&beside(cell, direction, 1)) else {
            continue;
        };
        let neighbour = &stars[other];
        let ray_back = (direction + 2 + 4 - other_turned) % 4;
        let offset = difference(candidate.position, neighbour.position);
        let off = turn(neighbour.rays[ray_back] - offset[1].atan2(offset[0])).abs();
        if off > DIRECTION_TOLERANCE {
            return None;
        }
        let ray = edge_between(blurred, neighbour, ray_back, candidate)?;
        let turned = (direction + 4 - ray) % 4;
        if agreed.is_some_and(|before| before != turned) {
            return None;
        }
        agreed = Some(turned);
    }
    agreed
}

/// The cell `steps` away in a grid direction (taken modulo 4).
pub(super) fn beside(cell: Cell, direction: usize, steps: i32) -> Cell {
    let step = DIRECTIONS[direction % 4];
    (cell.0 + steps * step.0, cell.1 + steps * step.1)
}

fn far(cell: Cell) -> bool {
    cell.0.abs() > FURTHEST || cell.1.abs() > FURTHEST
}

fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Euclidean distance.
fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [x, y] = difference(a, b);
    x.hypot(y)
}
