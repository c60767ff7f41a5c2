//! The payloads of generations, versions 1 to 3, and of jobs, version 1.

use super::payload::{from_json, instant, only, pack, to_json, unpack};
use super::record::{Family, Record};
use crate::model::{
    ClassId, ClassName, Generation, GenerationClass, GenerationShape, Job, JobFailure, JobId, JobState,
    Origin, ShapeId, Step,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

#[derive(Serialize, Deserialize)]
struct GenerationV1 {
    number: u64,
    parameters: String,
    created_at: i128,
    classes: Vec<GenerationClassV1>,
}

/// Version 1 with the key of the baselines' model after it.
#[derive(Serialize, Deserialize)]
struct GenerationV2 {
    first: GenerationV1,
    baselines: Option<String>,
}

/// Version 2 with the imported classes after it.
#[derive(Serialize, Deserialize)]
struct GenerationV3 {
    second: GenerationV2,
    imported: Vec<[u8; 16]>,
}

/// What `import` put into the keys of dictionaries before a generation knew which of its classes are imported.
const IMPORTED_KEY: &str = "-imported-";

#[derive(Serialize, Deserialize)]
struct GenerationClassV1 {
    class: [u8; 16],
    name: String,
    revision: u64,
    shapes: u64,
    dictionary: String,
    bytes: u64,
    atoms: u64,
    report: String,
    shape_dictionaries: Vec<([u8; 16], String)>,
}

impl Record for Generation {
    const FAMILY: Family = Family::Generation;
    const VERSION: u16 = 3;

    fn encode(&self) -> Result<Vec<u8>, String> {
        let classes = self
            .classes
            .iter()
            .map(|c| {
                Ok(GenerationClassV1 {
                    class: c.class.to_bytes(),
                    name: c.name.as_str().to_owned(),
                    revision: c.revision,
                    shapes: c.shapes as u64,
                    dictionary: c.dictionary.clone(),
                    bytes: c.bytes,
                    atoms: c.atoms as u64,
                    report: to_json(&c.report)?,
                    shape_dictionaries: c
                        .shape_dictionaries
                        .iter()
                        .map(|s| (s.shape.to_bytes(), s.dictionary.clone()))
                        .collect(),
                })
            })
            .collect::<Result<_, String>>()?;
        let imported = self.classes.iter().filter(|c| c.origin == Origin::Imported);
        pack(&GenerationV3 {
            second: GenerationV2 {
                first: GenerationV1 {
                    number: self.number,
                    parameters: to_json(&self.parameters)?,
                    created_at: self.created_at.as_nanosecond(),
                    classes,
                },
                baselines: self.baselines.clone(),
            },
            imported: imported.map(|c| c.class.to_bytes()).collect(),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        let before = |second: GenerationV2| GenerationV3 {
            imported: second
                .first
                .classes
                .iter()
                .filter(|c| c.dictionary.contains(IMPORTED_KEY))
                .map(|c| c.class)
                .collect(),
            second,
        };
        let GenerationV3 { second, imported } = match version {
            1 => before(GenerationV2 {
                first: unpack(payload)?,
                baselines: None,
            }),
            2 => before(unpack(payload)?),
            other => {
                only(other, 3)?;
                unpack(payload)?
            }
        };
        let GenerationV2 { first: v, baselines } = second;
        let imported: BTreeSet<[u8; 16]> = imported.into_iter().collect();
        let classes = v
            .classes
            .into_iter()
            .map(|c| {
                Ok(GenerationClass {
                    class: ClassId::from_bytes(c.class),
                    origin: if imported.contains(&c.class) {
                        Origin::Imported
                    } else {
                        Origin::Learnt
                    },
                    name: ClassName::stored(&c.name).map_err(|e| e.to_string())?,
                    revision: c.revision,
                    shapes: c.shapes as usize,
                    dictionary: c.dictionary,
                    bytes: c.bytes,
                    atoms: c.atoms as usize,
                    report: from_json(&c.report)?,
                    shape_dictionaries: c
                        .shape_dictionaries
                        .into_iter()
                        .map(|(shape, dictionary)| GenerationShape {
                            shape: ShapeId::from_bytes(shape),
                            dictionary,
                        })
                        .collect(),
                })
            })
            .collect::<Result<_, String>>()?;
        Ok(Self {
            number: v.number,
            parameters: from_json(&v.parameters)?,
            created_at: instant(v.created_at)?,
            classes,
            baselines,
        })
    }
}

#[derive(Serialize, Deserialize)]
struct JobV1 {
    id: [u8; 16],
    kind: String,
    state: u8,
    steps: Vec<(String, u64, u64)>,
    failure: Option<(String, String)>,
    enqueued_at: i128,
    started_at: Option<i128>,
    finished_at: Option<i128>,
    attempts: u32,
    generation: Option<u64>,
    result: Option<String>,
}

/// A state's number in records. It never changes.
fn state_number(state: JobState) -> u8 {
    match state {
        JobState::Enqueued => 0,
        JobState::Processing => 1,
        JobState::Succeeded => 2,
        JobState::Failed => 3,
        JobState::Cancelled => 4,
    }
}

fn state_of(number: u8) -> Result<JobState, String> {
    match number {
        0 => Ok(JobState::Enqueued),
        1 => Ok(JobState::Processing),
        2 => Ok(JobState::Succeeded),
        3 => Ok(JobState::Failed),
        4 => Ok(JobState::Cancelled),
        _ => Err(format!("unknown job state {number}")),
    }
}

impl Record for Job {
    const FAMILY: Family = Family::Job;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        pack(&JobV1 {
            id: self.id.to_bytes(),
            kind: to_json(&self.kind)?,
            state: state_number(self.state),
            steps: self
                .steps
                .iter()
                .map(|s| (s.name.clone(), s.finished as u64, s.total as u64))
                .collect(),
            failure: self.failure.clone().map(|f| (f.code, f.detail)),
            enqueued_at: self.enqueued_at.as_nanosecond(),
            started_at: self.started_at.map(|t| t.as_nanosecond()),
            finished_at: self.finished_at.map(|t| t.as_nanosecond()),
            attempts: self.attempts,
            generation: self.generation,
            result: self.result.as_ref().map(to_json).transpose()?,
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        only(version, 1)?;
        let v: JobV1 = unpack(payload)?;
        Ok(Self {
            id: JobId::from_bytes(v.id),
            kind: from_json(&v.kind)?,
            state: state_of(v.state)?,
            steps: v
                .steps
                .into_iter()
                .map(|(name, finished, total)| Step {
                    name,
                    finished: finished as usize,
                    total: total as usize,
                })
                .collect(),
            failure: v.failure.map(|(code, detail)| JobFailure { code, detail }),
            enqueued_at: instant(v.enqueued_at)?,
            started_at: v.started_at.map(instant).transpose()?,
            finished_at: v.finished_at.map(instant).transpose()?,
            attempts: v.attempts,
            generation: v.generation,
            result: v.result.as_deref().map(from_json).transpose()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shapelex_core::parameters::Parameters;

    fn first(dictionary: &str) -> GenerationV1 {
        GenerationV1 {
            number: 3,
            parameters: to_json(&Parameters::default()).unwrap(),
            created_at: 0,
            classes: vec![GenerationClassV1 {
                class: [7; 16],
                name: "cat".to_owned(),
                revision: 2,
                shapes: 5,
                dictionary: dictionary.to_owned(),
                bytes: 1,
                atoms: 1,
                report: "{\"channels\":{}}".to_owned(),
                shape_dictionaries: Vec::new(),
            }],
        }
    }

    #[test]
    fn a_generation_of_version_1_has_no_baselines() {
        let old = Generation::decode(1, &pack(&first("class-x")).unwrap()).unwrap();
        assert_eq!((old.number, &old.baselines), (3, &None));
        assert_eq!(old.classes[0].origin, Origin::Learnt);
        let mut new = old;
        new.baselines = Some("model-x".to_owned());
        let again = Generation::decode(Generation::VERSION, &new.encode().unwrap()).unwrap();
        assert_eq!(again, new);
        assert!(Generation::decode(4, &new.encode().unwrap()).is_err());
    }

    #[test]
    fn imported_classes_are_known_before_and_after_version_3() {
        let old = pack(&GenerationV2 {
            first: first("0190-imported-3"),
            baselines: None,
        });
        let old = Generation::decode(2, &old.unwrap()).unwrap();
        assert_eq!(old.classes[0].origin, Origin::Imported);
        let again = Generation::decode(Generation::VERSION, &old.encode().unwrap()).unwrap();
        assert_eq!(again, old);
    }
    #[test]
    fn every_state_of_a_job_comes_back_from_its_number() {
        for state in JobState::ALL {
            assert_eq!(state_of(state_number(state)), Ok(state));
        }
        assert_eq!(JobState::ALL.map(state_number), [0, 1, 2, 3, 4]);
        assert!(state_of(5).is_err());
    }
}
