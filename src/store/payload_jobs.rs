//! The payloads of generations, versions 1 and 2, and of jobs, version 1.

use super::payload::{from_json, instant, only, pack, to_json, unpack};
use super::record::{Family, Record};
use crate::model::{
    ClassId, ClassName, Generation, GenerationClass, GenerationShape, Job, JobFailure, JobId, JobState,
    ShapeId, Step,
};
use serde::{Deserialize, Serialize};

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
    const VERSION: u16 = 2;

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
        pack(&GenerationV2 {
            first: GenerationV1 {
                number: self.number,
                parameters: to_json(&self.parameters)?,
                created_at: self.created_at.as_nanosecond(),
                classes,
            },
            baselines: self.baselines.clone(),
        })
    }

    fn decode(version: u16, payload: &[u8]) -> Result<Self, String> {
        let GenerationV2 { first: v, baselines } = match version {
            1 => GenerationV2 {
                first: unpack(payload)?,
                baselines: None,
            },
            other => {
                only(other, 2)?;
                unpack(payload)?
            }
        };
        let classes = v
            .classes
            .into_iter()
            .map(|c| {
                Ok(GenerationClass {
                    class: ClassId::from_bytes(c.class),
                    name: ClassName::new(&c.name).map_err(|e| e.to_string())?,
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

impl Record for Job {
    const FAMILY: Family = Family::Job;
    const VERSION: u16 = 1;

    fn encode(&self) -> Result<Vec<u8>, String> {
        let state = match self.state {
            JobState::Enqueued => 0,
            JobState::Processing => 1,
            JobState::Succeeded => 2,
            JobState::Failed => 3,
            JobState::Cancelled => 4,
        };
        pack(&JobV1 {
            id: self.id.to_bytes(),
            kind: to_json(&self.kind)?,
            state,
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
        let state = *JobState::ALL
            .get(usize::from(v.state))
            .ok_or_else(|| format!("unknown job state {}", v.state))?;
        Ok(Self {
            id: JobId::from_bytes(v.id),
            kind: from_json(&v.kind)?,
            state,
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
    use crate::parameters::Parameters;

    #[test]
    fn a_generation_of_version_1_has_no_baselines() {
        let first = || GenerationV1 {
            number: 3,
            parameters: to_json(&Parameters::default()).unwrap(),
            created_at: 0,
            classes: Vec::new(),
        };
        let old = Generation::decode(1, &pack(&first()).unwrap()).unwrap();
        assert_eq!((old.number, &old.baselines), (3, &None));
        let mut new = old;
        new.baselines = Some("model-x".to_owned());
        let again = Generation::decode(Generation::VERSION, &new.encode().unwrap()).unwrap();
        assert_eq!(again, new);
        assert!(Generation::decode(3, &new.encode().unwrap()).is_err());
    }
}
