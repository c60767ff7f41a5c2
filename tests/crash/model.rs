//! What the service must hold, as one client knows it.

use crate::client::{Answer, Client};
use crate::mesh;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A class: its identifier, and the seeds of its shapes' meshes with their identifiers. An identifier is unknown where
/// no answer told it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Class {
    pub id: Option<String>,
    pub shapes: BTreeMap<u32, Option<String>>,
}

/// Classes by name.
pub type Catalogue = BTreeMap<String, Class>;

/// One change, by names and seeds.
#[derive(Clone, Debug)]
pub enum Change {
    Create(String),
    Rename(String, String),
    DeleteClass(String),
    /// Shapes for a class that is made where it does not exist.
    Upload(String, Vec<u32>),
    DeleteShape(String, u32),
}

/// A client that has the classes of one prefix for itself.
pub struct Worker {
    pub prefix: String,
    pub rng: ChaCha8Rng,
    /// What was acknowledged.
    pub known: Catalogue,
    /// The change that was under way when the service went away.
    pub pending: Option<Change>,
    /// Changes acknowledged so far.
    pub acknowledged: u64,
    next: u32,
}

impl Worker {
    pub fn new(number: u32, rng: ChaCha8Rng) -> Self {
        Self {
            prefix: format!("worker {number} "),
            rng,
            known: Catalogue::new(),
            pending: None,
            acknowledged: 0,
            next: number * 1_000_000,
        }
    }

    fn fresh(&mut self) -> u32 {
        self.next += 1;
        self.next
    }

    fn fresh_name(&mut self) -> String {
        let number = self.fresh();
        format!("{}{number}", self.prefix)
    }

    fn some_class(&mut self) -> Option<String> {
        let names: Vec<&String> = self.known.keys().collect();
        if names.is_empty() {
            return None;
        }
        Some(names[self.rng.random_range(0..names.len())].clone())
    }

    /// Any change that is possible now.
    pub fn choose(&mut self) -> Change {
        let count = self.rng.random_range(1..4);
        let seeds: Vec<u32> = (0..count).map(|_| self.fresh()).collect();
        let Some(class) = self.some_class() else {
            return Change::Upload(self.fresh_name(), seeds);
        };
        let full = self.known[&class].shapes.len() > 5;
        match self.rng.random_range(0..100) {
            0..10 => Change::Create(self.fresh_name()),
            10..25 => Change::Rename(class, self.fresh_name()),
            25..35 => Change::DeleteClass(class),
            _ if self.known.len() > 4 => Change::DeleteClass(class),
            35..50 => Change::Upload(self.fresh_name(), seeds),
            50..80 if !full => Change::Upload(class, seeds),
            _ => match self.known[&class].shapes.keys().next() {
                Some(seed) => Change::DeleteShape(class, *seed),
                None => Change::Upload(class, seeds),
            },
        }
    }

    /// Asks for a change and, once it is acknowledged, knows it. `false` where the service went away.
    ///
    /// # Panics
    /// Where the service refuses what it must do.
    pub fn ask(&mut self, client: &Client, change: Change) -> bool {
        self.pending = Some(change.clone());
        let Some(answer) = self.send(client, &change) else {
            return false;
        };
        if answer.code() == "shutting_down" {
            return false;
        }
        assert!(
            (200..300).contains(&answer.status),
            "{change:?} was refused: {}",
            answer.text()
        );
        let mut after = applied(&self.known, &change);
        let value = answer.value();
        learn(&mut after, &change, &value);
        self.known = after;
        self.pending = None;
        self.acknowledged += 1;
        true
    }

    fn send(&self, client: &Client, change: &Change) -> Option<Answer> {
        let class = |name: &str| self.known[name].id.clone().unwrap();
        match change {
            Change::Create(name) => client.json("POST", "/v1/classes", &json!({ "name": name })),
            Change::Rename(from, to) => client.json(
                "PATCH",
                &format!("/v1/classes/{}", class(from)),
                &json!({ "name": to }),
            ),
            Change::DeleteClass(name) => {
                client.json("DELETE", &format!("/v1/classes/{}", class(name)), &json!({}))
            }
            Change::Upload(name, seeds) => {
                let encoded = name.replace(' ', "%20");
                let path = format!("/v1/classes/{encoded}/shapes?create=true");
                let (media_type, body) = multipart(seeds);
                client.send("POST", &path, &media_type, body)
            }
            Change::DeleteShape(name, seed) => {
                let shape = self.known[name].shapes[seed].clone().unwrap();
                let path = format!("/v1/classes/{}/shapes/{shape}", class(name));
                client.json("DELETE", &path, &json!({}))
            }
        }
    }

    /// Compares what the service holds with what it must hold, and goes on from there.
    ///
    /// # Panics
    /// Where anything acknowledged is missing or changed, or anything is half there.
    pub fn check(&mut self, client: &Client) {
        let found = read(client, &self.prefix);
        let after = self.pending.take().map(|change| {
            let after = applied(&self.known, &change);
            (change, after)
        });
        let is_before = agrees(&found, &self.known);
        let is_after = after.as_ref().is_some_and(|(_, after)| agrees(&found, after));
        assert!(
            is_before || is_after,
            "neither before nor after {:?}:\nfound {found:#?}\nacknowledged {:#?}",
            after.map(|(change, _)| change),
            self.known
        );
        self.known = found;
    }
}

/// The catalogue after a change, with the new identifiers unknown.
fn applied(before: &Catalogue, change: &Change) -> Catalogue {
    let mut after = before.clone();
    match change {
        Change::Create(name) => {
            after.insert(name.clone(), Class::default());
        }
        Change::Rename(from, to) => {
            let class = after.remove(from).unwrap();
            after.insert(to.clone(), class);
        }
        Change::DeleteClass(name) => {
            after.remove(name);
        }
        Change::Upload(name, seeds) => {
            let class = after.entry(name.clone()).or_default();
            class.shapes.extend(seeds.iter().map(|seed| (*seed, None)));
        }
        Change::DeleteShape(name, seed) => {
            after.get_mut(name).unwrap().shapes.remove(seed);
        }
    }
    after
}

/// Takes the identifiers out of an answer.
fn learn(after: &mut Catalogue, change: &Change, answer: &Value) {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    match change {
        Change::Create(name) => after.get_mut(name).unwrap().id = text(&answer["id"]),
        Change::Upload(name, seeds) => {
            let class = after.get_mut(name).unwrap();
            class.id = text(&answer["class"]["id"]);
            let shapes = answer["shapes"].as_array().unwrap();
            assert_eq!(shapes.len(), seeds.len());
            for (seed, shape) in seeds.iter().zip(shapes) {
                class.shapes.insert(*seed, text(&shape["id"]));
            }
        }
        _ => {}
    }
}

/// Whether what was found is what is wanted, identifiers included where they are known.
pub fn agrees(found: &Catalogue, wanted: &Catalogue) -> bool {
    let same = |found: &Option<String>, wanted: &Option<String>| wanted.is_none() || found == wanted;
    found.keys().eq(wanted.keys())
        && found.values().zip(wanted.values()).all(|(found, wanted)| {
            same(&found.id, &wanted.id)
                && found.shapes.keys().eq(wanted.shapes.keys())
                && found
                    .shapes
                    .values()
                    .zip(wanted.shapes.values())
                    .all(|(f, w)| same(f, w))
        })
}

/// Everything under a prefix, each file read and compared with what was sent.
pub fn read(client: &Client, prefix: &str) -> Catalogue {
    let mut catalogue = Catalogue::new();
    for class in client.list("/v1/classes") {
        let name = class["name"].as_str().unwrap();
        if !name.starts_with(prefix) {
            continue;
        }
        let id = class["id"].as_str().unwrap();
        let mut shapes = BTreeMap::new();
        for shape in client.list(&format!("/v1/classes/{id}/shapes")) {
            let file = shape["name"].as_str().unwrap();
            let seed: u32 = file.strip_suffix(".off").unwrap().parse().unwrap();
            let original = client.get(shape["original"].as_str().unwrap());
            assert!(original.body == mesh(seed).into_bytes(), "{file} has other bytes");
            shapes.insert(seed, Some(shape["id"].as_str().unwrap().to_owned()));
        }
        assert_eq!(class["shapes"], shapes.len(), "{class}");
        let id = Some(id.to_owned());
        catalogue.insert(name.to_owned(), Class { id, shapes });
    }
    catalogue
}

fn multipart(seeds: &[u32]) -> (String, Vec<u8>) {
    let boundary = "crash-test-boundary";
    let mut body = String::new();
    for seed in seeds {
        body += &format!(
            "--{boundary}\r\ncontent-disposition: form-data; name=\"file\"; filename=\"{seed}.off\"\r\n\
             content-type: model/off\r\n\r\n{}\r\n",
            mesh(*seed)
        );
    }
    body += &format!("--{boundary}--\r\n");
    (
        format!("multipart/form-data; boundary={boundary}"),
        body.into_bytes(),
    )
}
