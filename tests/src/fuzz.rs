//! Files as strangers could have made them, read as a user's file is. No reader may panic, hang or take much memory.
//!
//! A case is a function of the seed and its number: a few files of the [`corpus`], some of them changed by
//! [`mutation`]. [`reading`] does what a command does with such files. [`supervisor`] runs cases in processes of their
//! own, because a case that aborts, hangs or runs out of memory ends its process.

pub mod corpus;
pub mod mutation;
pub mod reading;
pub mod supervisor;

use std::collections::BTreeMap;

use corpus::Corpus;

use crate::random::Random;

/// Files that are read together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Case {
    /// The file that a user would name.
    pub main: String,
    /// All files by their names, the main one among them.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// Most mutations of a file.
const MOST_MUTATIONS: f64 = 6.0;

impl Case {
    /// The case of this number.
    pub fn new(corpus: &Corpus, seed: u64, number: u64) -> Self {
        let mut random = Random::new(seed, number);
        let mut case = corpus.choice(&mut random).clone();
        let other = corpus.choice(&mut random);
        let names: Vec<String> = case.files.keys().cloned().collect();
        // Mostly the main file.
        let name = if random.uniform() < 0.7 { case.main.clone() } else { chosen(&names, &mut random).clone() };
        let count = 1 + (MOST_MUTATIONS * random.uniform() * random.uniform()) as usize;
        for _ in 0..count {
            let donors: Vec<&Vec<u8>> = other.files.values().collect();
            let donor = *chosen(&donors, &mut random);
            let bytes = case.files.get_mut(&name).expect("a file of the case");
            *bytes = mutation::mutated(&name, bytes, donor, &mut random);
        }
        case
    }
}

/// One of several things.
///
/// # Panics
///
/// When there are none.
fn chosen<'a, T>(things: &'a [T], random: &mut Random) -> &'a T {
    &things[(random.uniform() * things.len() as f64) as usize]
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;

    /// Time for cases in the tests of each commit. The long tests take minutes.
    const TIME: Duration = Duration::from_secs(3);

    #[test]
    fn files_that_once_were_trouble_are_read_or_refused() {
        for (name, case) in corpus::cases("found") {
            let start = Instant::now();
            let _ = reading::read(&case, tempfile::tempdir().unwrap().path());
            assert!(start.elapsed() < Duration::from_secs(20), "{name} took {:?}", start.elapsed());
        }
    }

    #[test]
    fn seeds_are_scenes_and_what_is_made_of_them_is_read_or_refused() {
        let folder = tempfile::tempdir().unwrap();
        for (name, case) in corpus::cases("seeds") {
            assert_eq!(reading::read(&case, folder.path()), Ok(()), "{name}");
        }
        let corpus = Corpus::kept();
        let (start, mut refused, mut number) = (Instant::now(), 0, 0);
        while start.elapsed() < TIME {
            refused += u64::from(reading::read(&Case::new(&corpus, 1, number), folder.path()).is_err());
            number += 1;
        }
        // Neither are the changes harmless, nor are they so coarse that nothing gets past the first check.
        assert!(number > 20 && refused > number / 10 && refused < number, "{refused} of {number} are refused");
    }

    #[test]
    fn a_case_is_a_function_of_its_number() {
        let corpus = Corpus::kept();
        assert_eq!(Case::new(&corpus, 1, 7), Case::new(&corpus, 1, 7));
        let different = (0..50).filter(|number| Case::new(&corpus, 1, *number) != Case::new(&corpus, 2, *number));
        assert!(different.count() > 40);
    }
}
