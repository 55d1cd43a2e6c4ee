//! Evolution strategies over a log-fitness: the optimiser and the Metropolis-Hastings-correct mover.
