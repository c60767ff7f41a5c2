//! Tensors on their way into a safetensors file.

use safetensors::tensor::Dtype;
use std::collections::BTreeMap;

/// Name → type, shape and bytes of a tensor.
pub(super) type Tensors = BTreeMap<String, (Dtype, Vec<usize>, Vec<u8>)>;
