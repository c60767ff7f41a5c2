//! Clips and their values at a moment (glTF 2.0, 3.11 and appendix C).

use super::document::Document;
use super::matrix::slerp;
use super::scene::NodeState;
use crate::mesh::MeshError;
use gltf::json::accessor::Type;
use gltf::json::animation::{Animation, Channel, Interpolation, Property};
use gltf::json::validation::Checked;
use gltf::json::{Index, accessor::Accessor};
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// One animation of the file.
pub(super) struct Clip<'d> {
    /// Its name, or `clip` and its number.
    pub name: String,
    animation: &'d Animation,
}

/// What a channel moves, if it is something that has a shape.
fn property(channel: &Channel) -> Option<Property> {
    match channel.target.path {
        Checked::Valid(property) => Some(property),
        Checked::Invalid => None,
    }
}

impl<'d> Clip<'d> {
    /// The animations with at least one channel that moves a node or a morph target.
    pub fn list(document: &'d Document<'_>) -> Result<Vec<Self>, MeshError> {
        let animations = document.root.animations.iter().enumerate();
        Ok(animations
            .filter(|(_, animation)| animation.channels.iter().any(|c| property(c).is_some()))
            .map(|(k, animation)| Self {
                name: animation.name.clone().unwrap_or_else(|| format!("clip{k}")),
                animation,
            })
            .collect())
    }

    /// Sets the state of everything the clip moves to `moment`, 0 to 1 from its first key to its last.
    pub fn apply(
        &self,
        document: &Document<'_>,
        moment: f64,
        state: &mut [NodeState],
    ) -> Result<(), MeshError> {
        let mut times: HashMap<usize, Vec<f64>> = HashMap::new();
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        for sampler in &self.animation.samplers {
            if let Entry::Vacant(slot) = times.entry(sampler.input.value()) {
                let keys = slot.insert(scalars(document, sampler.input, "animation keys")?);
                first = keys.iter().copied().fold(first, f64::min);
                last = keys.iter().copied().fold(last, f64::max);
            }
        }
        let time = first + moment * (last - first);
        for channel in &self.animation.channels {
            let Some(property) = property(channel) else {
                continue;
            };
            let sampler = document.get(
                &self.animation.samplers,
                channel.sampler.value(),
                "animation sampler",
            )?;
            let node = channel.target.node.value();
            document.get(&document.root.nodes, node, "node")?;
            let keys = &times[&sampler.input.value()];
            let Checked::Valid(interpolation) = sampler.interpolation else {
                return Err(document.malformed("an animation sampler has an unknown interpolation"));
            };
            let values = match property {
                Property::Translation | Property::Scale => vectors(document, sampler.output, Type::Vec3)?,
                Property::Rotation => vectors(document, sampler.output, Type::Vec4)?,
                Property::MorphTargetWeights => scalars(document, sampler.output, "animation values")?,
            };
            let per_key = if interpolation == Interpolation::CubicSpline {
                3
            } else {
                1
            };
            let width = match property {
                Property::Translation | Property::Scale => 3,
                Property::Rotation => 4,
                Property::MorphTargetWeights => values.len() / (keys.len() * per_key).max(1),
            };
            if keys.is_empty() || width == 0 {
                continue;
            }
            if values.len() < keys.len() * per_key * width {
                return Err(document.malformed(format!(
                    "animation `{}` has {} values for {} keys",
                    self.name,
                    values.len() / width,
                    keys.len()
                )));
            }
            let track = Track {
                keys,
                values: &values,
                width,
                interpolation,
                rotation: property == Property::Rotation,
            };
            let value = track.at(time);
            let state = &mut state[node];
            match property {
                Property::Translation => state.translation = std::array::from_fn(|k| value[k]),
                Property::Scale => state.scale = std::array::from_fn(|k| value[k]),
                Property::Rotation => state.rotation = std::array::from_fn(|k| value[k]),
                Property::MorphTargetWeights => state.weights = Some(value),
            }
            if property != Property::MorphTargetWeights {
                // A node that moves must not be given by a matrix; where one is, the clip wins.
                state.matrix = None;
            }
        }
        Ok(())
    }
}

fn scalars(
    document: &Document<'_>,
    accessor: Index<Accessor>,
    what: &'static str,
) -> Result<Vec<f64>, MeshError> {
    document.numbers(accessor, Type::Scalar, document.limits.max_bytes, what, |x| x)
}

fn vectors(document: &Document<'_>, accessor: Index<Accessor>, kind: Type) -> Result<Vec<f64>, MeshError> {
    document.numbers(
        accessor,
        kind,
        document.limits.max_bytes,
        "animation values",
        |x| x,
    )
}

/// Keys and values of one channel.
struct Track<'t> {
    /// Times in seconds, ascending and not empty.
    keys: &'t [f64],
    /// `width` numbers per key; for cubic splines an in-tangent, a value and an out-tangent of `width` each.
    values: &'t [f64],
    width: usize,
    interpolation: Interpolation,
    rotation: bool,
}

impl Track<'_> {
    /// The value at a time; before the first key and after the last, theirs.
    fn at(&self, time: f64) -> Vec<f64> {
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let per_key = if cubic { 3 } else { 1 };
        // Within key `k`, the in-tangent, the value or the out-tangent of a cubic spline.
        let entry = |k: usize, which: usize| {
            let at = (k * per_key + which) * self.width;
            &self.values[at..at + self.width]
        };
        let value = |k: usize| entry(k, if cubic { 1 } else { 0 });
        let after = self.keys.partition_point(|&key| key <= time);
        if after == 0 {
            return value(0).to_vec();
        }
        let before = after - 1;
        if after == self.keys.len() || self.interpolation == Interpolation::Step {
            return value(before).to_vec();
        }
        let duration = self.keys[after] - self.keys[before];
        let t = (time - self.keys[before]) / duration;
        let (a, b) = (value(before), value(after));
        match self.interpolation {
            Interpolation::CubicSpline => {
                let (out, into) = (entry(before, 2), entry(after, 0));
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

    fn track(values: &[f64], interpolation: Interpolation) -> Track<'_> {
        Track {
            keys: &[1.0, 3.0],
            values,
            width: 1,
            interpolation,
            rotation: false,
        }
    }

    #[test]
    fn each_interpolation_at_its_keys_and_between() {
        let linear = track(&[10.0, 20.0], Interpolation::Linear);
        let step = track(&[10.0, 20.0], Interpolation::Step);
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
        let cubic = track(&[9.0, 0.0, 2.0, 0.0, 0.0, 9.0], Interpolation::CubicSpline);
        assert_eq!(cubic.at(1.0), [0.0]);
        assert_eq!(cubic.at(2.0), [0.5]);
        assert_eq!(cubic.at(3.0), [0.0]);
    }
}
