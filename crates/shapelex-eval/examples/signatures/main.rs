//! How much a local signature adds to the WKS, on sets of real meshes.
//!
//! `signatures DATA CACHE [set=NAME,…] [radii=0.08,0.15] [keypoints=400] [lambda=0.3] [atoms=128] …`: DATA holds the sets
//! as folders `set/class/pose`; CACHE keeps prepared meshes and the scores of the WKS. For each set one line: queries,
//! right answers by WKS, by the local signature and by both, for several weights of the local one.

mod fuse;
mod local;
mod rows;
mod sets;
mod settings;
mod wks;

use settings::Settings;
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [data, cache, rest @ ..] = arguments.as_slice() else {
        return Err("usage: signatures DATA CACHE [NAME=VALUE…]".into());
    };
    let settings = Settings::parse(rest)?;
    let cache = PathBuf::from(cache);
    std::fs::create_dir_all(&cache)?;
    println!("{settings}");
    println!("{}", fuse::header());
    for name in &settings.sets {
        let started = Instant::now();
        let set = sets::load(name, data.as_ref(), &cache, &settings)?;
        let wks = wks::rows(&set, &cache, &settings)?;
        let described = Instant::now();
        let local = local::rows(&set, &settings)?;
        fuse::report(&set, &wks, &local, &settings);
        eprintln!(
            "{name}: {:.0} s, of which {:.0} s local",
            started.elapsed().as_secs_f64(),
            described.elapsed().as_secs_f64()
        );
    }
    Ok(())
}
