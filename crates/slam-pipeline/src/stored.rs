//! The form in bytes of values that have none of their own.

/// A descriptor as 128 bytes behind a box.
pub(crate) mod descriptor {
    use feature_kdtree::Descriptor;
    use serde::de::Error as _;
    use serde::{Deserialize as _, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(
        descriptor: &Descriptor,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(descriptor)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Box<Descriptor>, D::Error> {
        let bytes = <&[u8]>::deserialize(deserializer)?;
        match Descriptor::try_from(bytes) {
            Ok(descriptor) => Ok(Box::new(descriptor)),
            Err(_) => Err(D::Error::invalid_length(bytes.len(), &"128 bytes")),
        }
    }
}

/// A list whose entries nothing else shares once they are stored.
pub(crate) mod arcs {
    use std::sync::Arc;

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<T: Serialize, S: Serializer>(
        list: &[Arc<T>],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(list.iter().map(|entry| &**entry))
    }

    pub(crate) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<Arc<T>>, D::Error> {
        let list = Vec::deserialize(deserializer)?;
        Ok(list.into_iter().map(Arc::new).collect())
    }
}
