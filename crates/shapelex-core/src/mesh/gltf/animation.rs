//! Clips and their values at a moment (glTF 2.0, 3.11 and appendix C).

use super::accessor::Column;
use super::document::Document;
use super::list::shortened;
use super::matrix::slerp;
use super::nodes::NodeState;
use super::schema::{self, Channel, Index, Sampler};
use super::work::BLOCK;
use crate::mesh::MeshError;
use gltf::json::accessor::Type;
use gltf::json::animation::{Interpolation, Property};
use gltf::json::validation::Checked;
use std::collections::BTreeSet;

const STEPS: &str = "steps of reading its animation";

/// A channel that moves a node or a morph target.
struct Mover {
    node: usize,
    property: Property,
    sampler: usize,
}

/// One animation of the file.
pub(super) struct Clip {
    /// Its name, or `clip` and its number.
    pub name: String,
    movers: Vec<Mover>,
    /// `None` where a sampler cannot be read; channels of things without a shape may use it.
    samplers: Vec<Option<Sampler>>,
}

/// What a channel moves, if it is something that has a shape: a channel without a node is to be ignored (glTF 2.0,
/// 5.4.1), and one with another path belongs to an extension.
fn mover(channel: &Channel) -> Option<Mover> {
    let Checked::Valid(property) = channel.target.path else {
        return None;
    };
    Some(Mover {
        node: channel.target.node?.value(),
        property,
        sampler: channel.sampler.value(),
    })
}

impl Clip {
    /// The animations with at least one channel that moves a node or a morph target.
    pub fn list(document: &Document<'_>) -> Result<Vec<Self>, MeshError> {
        let animations = document.animations()?;
        let mut clips = Vec::new();
        for k in 0..animations.elements().len() {
            let animation: schema::Animation<'_> = document.get(&animations, k)?;
            let channels = animation.channels.iter().flatten();
            let movers: Vec<Mover> = channels
                .filter_map(|raw| serde_json::from_str(raw.get()).ok())
                .filter_map(|channel: Channel| mover(&channel))
                .collect();
            if movers.is_empty() {
                continue;
            }
            let samplers = animation.samplers.iter().flatten();
            clips.push(Self {
                name: animation
                    .name
                    .and_then(schema::text)
                    .map_or_else(|| format!("clip{k}"), |name| shortened(&name)),
                movers,
                samplers: samplers.map(|raw| serde_json::from_str(raw.get()).ok()).collect(),
            });
        }
        Ok(clips)
    }

    /// Opens what the channels move things by.
    pub fn tracks<'s>(&self, document: &'s Document<'_>) -> Result<Tracks<'s>, MeshError> {
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut seen: BTreeSet<Index> = BTreeSet::new();
        let mut tracks = Vec::with_capacity(self.movers.len());
        for mover in &self.movers {
            document.element(&document.nodes, mover.node)?;
            let sampler = self.samplers.get(mover.sampler).and_then(Option::as_ref);
            let sampler = sampler.ok_or_else(|| {
                document.malformed(format!(
                    "animation `{}` has no readable sampler {}",
                    self.name, mover.sampler
                ))
            })?;
            let keys = document.column(&document.accessor(sampler.input)?, Type::Scalar, "animation keys")?;
            if seen.insert(sampler.input) {
                for k in 0..keys.count {
                    if k % BLOCK == 0 {
                        document.work.spend(BLOCK.min(keys.count - k), 5, STEPS)?;
                    }
                    first = first.min(keys.number(k, 0));
                    last = last.max(keys.number(k, 0));
                }
            }
            tracks.extend(self.track(document, mover, sampler, keys)?);
        }
        Ok(Tracks { first, last, tracks })
    }

    /// A channel's values; `None` where it has none.
    fn track<'s>(
        &self,
        document: &'s Document<'_>,
        mover: &Mover,
        sampler: &Sampler,
        keys: Column<'s>,
    ) -> Result<Option<Track<'s>>, MeshError> {
        let interpolation = match sampler.interpolation {
            Some(Checked::Valid(interpolation)) => interpolation,
            None => Interpolation::Linear,
            Some(Checked::Invalid) => {
                return Err(document.malformed("an animation sampler has an unknown interpolation"));
            }
        };
        let kind = match mover.property {
            Property::Translation | Property::Scale => Type::Vec3,
            Property::Rotation => Type::Vec4,
            Property::MorphTargetWeights => Type::Scalar,
        };
        let values = document.column(&document.accessor(sampler.output)?, kind, "animation values")?;
        let per_key = per_key(interpolation);
        // Weights are scalars, as many for each key as there are morph targets.
        let width = match kind {
            Type::Scalar => values.count / (keys.count * per_key).max(1),
            _ => kind.multiplicity(),
        };
        if keys.count == 0 || width == 0 {
            return Ok(None);
        }
        if kind != Type::Scalar && values.count < keys.count.saturating_mul(per_key) {
            return Err(document.malformed(format!(
                "animation `{}` has {} values for {} keys",
                self.name, values.count, keys.count
            )));
        }
        Ok(Some(Track {
            node: mover.node,
            property: mover.property,
            curve: Curve {
                keys,
                values,
                width,
                interpolation,
                rotation: mover.property == Property::Rotation,
            },
        }))
    }
}

/// A clip whose keys and values are open.
pub(super) struct Tracks<'s> {
    first: f64,
    last: f64,
    tracks: Vec<Track<'s>>,
}

struct Track<'s> {
    node: usize,
    property: Property,
    curve: Curve<'s>,
}

impl Tracks<'_> {
    /// Sets the state of everything the clip moves to `moment`, 0 to 1 from its first key to its last.
    pub fn apply(
        &self,
        document: &Document<'_>,
        moment: f64,
        state: &mut [NodeState],
    ) -> Result<(), MeshError> {
        let time = self.first + moment * (self.last - self.first);
        for track in &self.tracks {
            document.work.spend(track.curve.width + 12, 10, STEPS)?;
            let value = track.curve.at(time);
            let state = &mut state[track.node];
            match track.property {
                Property::Translation => state.translation = std::array::from_fn(|k| value[k]),
                Property::Scale => state.scale = std::array::from_fn(|k| value[k]),
                Property::Rotation => state.rotation = std::array::from_fn(|k| value[k]),
                Property::MorphTargetWeights => state.weights = Some(value),
            }
            // A node that moves must not be given by a matrix; where one is, the clip wins.
            state.moved |= track.property != Property::MorphTargetWeights;
        }
        Ok(())
    }
}

/// Entries of the values for each key: a cubic spline has two tangents beside the value.
fn per_key(interpolation: Interpolation) -> usize {
    match interpolation {
        Interpolation::CubicSpline => 3,
        Interpolation::Linear | Interpolation::Step => 1,
    }
}

/// Keys and values of one channel.
struct Curve<'s> {
    /// Times in seconds, ascending and not empty.
    keys: Column<'s>,
    /// `width` numbers per key; for cubic splines an in-tangent, a value and an out-tangent of `width` each.
    values: Column<'s>,
    width: usize,
    interpolation: Interpolation,
    rotation: bool,
}

impl Curve<'_> {
    /// Within key `k`, the in-tangent, the value or the out-tangent of a cubic spline.
    fn entry(&self, k: usize, which: usize) -> Vec<f64> {
        let at = k * per_key(self.interpolation) + which;
        (0..self.width)
            .map(|i| match self.values.components() {
                1 => self.values.number(at * self.width + i, 0),
                _ => self.values.number(at, i),
            })
            .collect()
    }

    /// How many keys are not after a time.
    fn keys_until(&self, time: f64) -> usize {
        let (mut low, mut high) = (0, self.keys.count);
        while low < high {
            let middle = low + (high - low) / 2;
            if self.keys.number(middle, 0) <= time {
                low = middle + 1;
            } else {
                high = middle;
            }
        }
        low
    }

    /// The value at a time; before the first key and after the last, theirs.
    fn at(&self, time: f64) -> Vec<f64> {
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let value = |k: usize| self.entry(k, usize::from(cubic));
        let after = self.keys_until(time);
        if after == 0 {
            return value(0);
        }
        let before = after - 1;
        if after == self.keys.count || self.interpolation == Interpolation::Step {
            return value(before);
        }
        let duration = self.keys.number(after, 0) - self.keys.number(before, 0);
        let t = (time - self.keys.number(before, 0)) / duration;
        let (a, b) = (value(before), value(after));
        match self.interpolation {
            Interpolation::CubicSpline => {
                let (out, into) = (self.entry(before, 2), self.entry(after, 0));
                let (t2, t3) = (t * t, t * t * t);
                (0..self.width)
                    .map(|k| {
                        (2.0 * t3 - 3.0 * t2 + 1.0) * a[k]
                            + duration * (t3 - 2.0 * t2 + t) * out[k]
                            + (3.0 * t2 - 2.0 * t3) * b[k]
                            + duration * (t3 - t2) * into[k]
                    })
                    .collect()
            }
            _ if self.rotation => {
                slerp(std::array::from_fn(|k| a[k]), std::array::from_fn(|k| b[k]), t).to_vec()
            }
            _ => a.iter().zip(b).map(|(a, b)| a + t * (b - a)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gltf::json::accessor::ComponentType;

    fn scalars(numbers: &[f32]) -> Column<'static> {
        Column::decoded(numbers.to_vec(), None, 1, (ComponentType::F32, false))
    }

    fn curve(values: &[f32], interpolation: Interpolation) -> Curve<'static> {
        Curve {
            keys: scalars(&[1.0, 3.0]),
            values: scalars(values),
            width: 1,
            interpolation,
            rotation: false,
        }
    }

    #[test]
    fn each_interpolation_at_its_keys_and_between() {
        let linear = curve(&[10.0, 20.0], Interpolation::Linear);
        let step = curve(&[10.0, 20.0], Interpolation::Step);
        for (time, l, s) in [
            (0.0, 10.0, 10.0),
            (1.0, 10.0, 10.0),
            (1.5, 12.5, 10.0),
            (3.0, 20.0, 20.0),
            (9.0, 20.0, 20.0),
        ] {
            assert_eq!(linear.at(time), [l]);
            assert_eq!(step.at(time), [s]);
        }
        // f(1) = 0, f'(1) = 2, f(3) = 0, f'(3) = 0: at the middle, duration · (1/8) · f'(1) = 0.5.
        let cubic = curve(&[9.0, 0.0, 2.0, 0.0, 0.0, 9.0], Interpolation::CubicSpline);
        assert_eq!(cubic.at(1.0), [0.0]);
        assert_eq!(cubic.at(2.0), [0.5]);
        assert_eq!(cubic.at(3.0), [0.0]);
    }
}
