//! The sets: prepared meshes, what trains and what is queried.

use super::settings::Settings;
use serde::{Deserialize, Serialize};
use shapelex_core::mesh::{Limits, PrepareOptions, Source, TriMesh, TriangleSoup, prepare, read};
use shapelex_core::parameters::Parameters;
use shapelex_eval::benchmark::deform::Deformation;
use shapelex_eval::benchmark::{Protocol, Round, rounds};
use std::error::Error;
use std::path::{Path, PathBuf};

/// Draws of one-shot.
const DRAWS: usize = 5;
/// Shares of a training shape's area that parts cut from it have.
const SHARES: [f64; 4] = [0.3, 0.45, 0.6, 0.75];

/// A prepared mesh.
#[derive(Clone, Debug)]
pub struct Shape {
    pub class: String,
    pub name: String,
    pub mesh: TriMesh,
    /// Area in the file's squared units.
    pub area: f64,
    pub open: bool,
    pub soup: TriangleSoup,
}

#[derive(Debug)]
pub struct Set {
    pub name: String,
    pub shapes: Vec<Shape>,
    pub rounds: Vec<Round>,
    /// Shapes that tell how well a signature separates, by round; empty where the queries do.
    pub probes: Vec<Vec<usize>>,
    pub same: Vec<Vec<String>>,
}

#[derive(Serialize, Deserialize)]
struct Kept {
    vertices: Vec<[f64; 3]>,
    faces: Vec<[u32; 3]>,
    signature_vertices: usize,
    area: f64,
    open: bool,
}

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Reads and prepares a set by its name.
pub fn load(name: &str, data: &Path, cache: &Path, settings: &Settings) -> Result<Set> {
    let (set, protocol) = name.split_once('-').unwrap_or((name, ""));
    let loader = Loader { cache, settings };
    let men = vec![vec!["david".to_owned(), "michael".to_owned()]];
    let folder = |set| -> &str {
        match set {
            "shrec07" => "shrec07_half",
            "faust" => "faust_half",
            "animals" => "quaternius_animals",
            _ => "tosca_lowres",
        }
    };
    if let "cuts" | "holes" = set {
        return loader.parts(name, &data.join("shrec16_partial"), men);
    }
    if set == "deformed" {
        return loader.deformed(name, data, men);
    }
    let mut shapes = loader.folder(&data.join(folder(set)))?;
    shapes.retain(|shape| shape.class != "shark");
    let classes: Vec<&str> = shapes.iter().map(|s| s.class.as_str()).collect();
    let names: Vec<&str> = shapes.iter().map(|s| s.name.as_str()).collect();
    let protocol = match protocol {
        "loo" => Protocol::LeaveOneOut,
        _ => Protocol::OneShot {
            draws: DRAWS,
            seed: 1,
        },
    };
    let rounds = rounds(protocol, &classes, &names);
    let probes = match protocol {
        Protocol::LeaveOneOut => Vec::new(),
        _ => rounds.iter().map(trained).collect(),
    };
    Ok(Set {
        name: name.to_owned(),
        shapes,
        rounds,
        probes,
        same: men,
    })
}

fn trained(round: &Round) -> Vec<usize> {
    round.train.values().flatten().copied().collect()
}

struct Loader<'a> {
    cache: &'a Path,
    settings: &'a Settings,
}

impl Loader<'_> {
    fn parts(&self, name: &str, data: &Path, same: Vec<Vec<String>>) -> Result<Set> {
        let mut shapes = self.folder(&data.join("null"))?;
        let nulls = shapes.len();
        let mut round = Round {
            train: shapes
                .iter()
                .enumerate()
                .map(|(i, s)| (s.class.clone(), vec![i]))
                .collect(),
            query: Vec::new(),
        };
        shapes.extend(self.folder(&data.join(name))?);
        round.query = (nulls..shapes.len()).collect();
        let mut probes: Vec<usize> = (0..nulls).collect();
        for i in 0..nulls {
            for (n, share) in SHARES.into_iter().enumerate() {
                let soup = cut(&shapes[i].soup, share, i * SHARES.len() + n);
                let class = shapes[i].class.clone();
                probes.push(shapes.len());
                shapes.push(self.prepared(soup, class, format!("part {share}"))?);
            }
        }
        Ok(Set {
            name: name.to_owned(),
            shapes,
            rounds: vec![round],
            probes: vec![probes],
            same,
        })
    }

    /// The first pose of each TOSCA class of the twelve nulls, simplified to 1500 vertices, and its deformations.
    fn deformed(&self, name: &str, data: &Path, same: Vec<Vec<String>>) -> Result<Set> {
        let mut shapes: Vec<Shape> = Vec::new();
        let mut round = Round {
            train: Default::default(),
            query: Vec::new(),
        };
        for class in [
            "cat", "centaur", "david", "dog", "gorilla", "horse", "lioness", "michael", "victoria", "wolf",
        ] {
            let soup = soup_of(&data.join(format!("tosca_lowres/{class}/{class}0.off")))?;
            let options = PrepareOptions {
                working_size: 1500,
                ..Parameters::default().prepare_options()
            };
            let (mesh, _) = prepare(soup, &options)?;
            let (vertices, faces) = mesh.into_parts();
            let null = TriangleSoup {
                vertices,
                faces,
                ..TriangleSoup::default()
            };
            round.train.insert(class.to_owned(), vec![shapes.len()]);
            shapes.push(self.prepared(null.clone(), class.to_owned(), "null".to_owned())?);
            for deformation in Deformation::ALL {
                for strength in Deformation::STRENGTHS {
                    let seed = 1 ^ (shapes.len() as u64 + 1) << 8;
                    let soup = deformation.apply(&null, strength, seed);
                    round.query.push(shapes.len());
                    shapes.push(self.prepared(
                        soup,
                        class.to_owned(),
                        format!("{}-{strength}", deformation.name()),
                    )?);
                }
            }
        }
        let mut probes = trained(&round);
        for i in probes.clone() {
            for (n, share) in SHARES.into_iter().enumerate() {
                let soup = cut(&shapes[i].soup, share, i * SHARES.len() + n);
                let class = shapes[i].class.clone();
                probes.push(shapes.len());
                shapes.push(self.prepared(soup, class, format!("part {share}"))?);
            }
        }
        Ok(Set {
            name: name.to_owned(),
            shapes,
            rounds: vec![round],
            probes: vec![probes],
            same,
        })
    }

    fn folder(&self, folder: &Path) -> Result<Vec<Shape>> {
        let mut shapes = Vec::new();
        for class in sorted(folder)?.into_iter().filter(|p| p.is_dir()) {
            let label = class
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            for file in sorted(&class)? {
                let name = file
                    .file_name()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into_owned();
                shapes.push(self.prepared(soup_of(&file)?, label.clone(), name)?);
            }
        }
        Ok(shapes)
    }

    fn prepared(&self, soup: TriangleSoup, class: String, name: String) -> Result<Shape> {
        let mut hash = blake3::Hasher::new();
        hash.update(self.settings.working_size.to_string().as_bytes());
        hash.update(&serde_json::to_vec(&(&soup.vertices, &soup.faces))?);
        let at = self
            .cache
            .join(format!("{}.json", &hash.finalize().to_hex()[..24]));
        let kept: Kept = match std::fs::read(&at) {
            Ok(bytes) => serde_json::from_slice(&bytes)?,
            Err(_) => {
                let options = PrepareOptions {
                    working_size: self.settings.working_size,
                    ..Parameters::default().prepare_options()
                };
                let (mesh, report) = prepare(soup.clone(), &options)?;
                let kept = Kept {
                    vertices: mesh.vertices().to_vec(),
                    faces: mesh.faces().to_vec(),
                    signature_vertices: mesh.signature_vertices(),
                    area: report.area,
                    open: report.is_open(),
                };
                std::fs::write(&at, serde_json::to_vec(&kept)?)?;
                kept
            }
        };
        Ok(Shape {
            class,
            name,
            mesh: TriMesh::new(kept.vertices, kept.faces, kept.signature_vertices)?,
            area: kept.area,
            open: kept.open,
            soup,
        })
    }
}

fn sorted(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(|error| format!("{}: {error}", folder.display()))?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<std::result::Result<_, _>>()?;
    entries.sort();
    Ok(entries)
}

fn soup_of(file: &Path) -> Result<TriangleSoup> {
    let bytes = std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))?;
    let source = Source {
        bytes: &bytes,
        ..Source::default()
    };
    Ok(read(&source, &Limits::default())?.1)
}

/// The faces on one side of a plane, so that a share of them is left; directions are spread over the sphere.
fn cut(soup: &TriangleSoup, share: f64, number: usize) -> TriangleSoup {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let height = 1.0 - 2.0 * ((number as f64 * 0.618_033_988_749_895).fract());
    let (angle, width) = (golden * number as f64, (1.0 - height * height).sqrt());
    let direction = [width * angle.cos(), width * angle.sin(), height];
    let along = |face: &[u32; 3]| -> f64 {
        face.iter()
            .map(|&v| {
                (0..3)
                    .map(|k| direction[k] * soup.vertices[v as usize][k])
                    .sum::<f64>()
            })
            .sum()
    };
    let mut heights: Vec<f64> = soup.faces.iter().map(along).collect();
    heights.sort_by(f64::total_cmp);
    let limit = heights[((heights.len() as f64 * share) as usize).min(heights.len() - 1)];
    TriangleSoup {
        vertices: soup.vertices.clone(),
        faces: soup.faces.iter().filter(|f| along(f) < limit).copied().collect(),
        ..TriangleSoup::default()
    }
}
