//! Integration tests of the study, one module a subject.

mod study;
