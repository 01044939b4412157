//! Tables of plugins: look-up by name, listing, extension.

use crate::error::{Error, Result};

/// What every plugin's entry tells of itself.
pub trait Entry {
    /// Family, for messages: "integrator", "light", …
    const KIND: &'static str;
    /// Unique name within the family.
    fn name(&self) -> &'static str;
    /// One sentence.
    fn doc(&self) -> &'static str;
}

/// The plugins of one family, in order of preference.
#[derive(Clone, Debug)]
pub struct Table<E> {
    entries: Vec<E>,
}

impl<E: Entry + Copy> Table<E> {
    /// A table of the given entries.
    pub fn new(entries: &[E]) -> Self {
        Self {
            entries: entries.to_vec(),
        }
    }

    /// All entries.
    pub fn entries(&self) -> &[E] {
        &self.entries
    }

    /// The entry named `name`.
    ///
    /// # Errors
    /// [`Error::UnknownPlugin`] with the list of known names.
    pub fn find(&self, name: &str) -> Result<&E> {
        self.entries
            .iter()
            .find(|e| e.name() == name)
            .ok_or_else(|| Error::UnknownPlugin {
                kind: E::KIND,
                name: name.into(),
                known: self
                    .entries
                    .iter()
                    .map(E::name)
                    .collect::<Vec<_>>()
                    .join(", "),
            })
    }

    /// The entry named `name`, or the first if no name is given.
    ///
    /// # Errors
    /// As [`find`](Self::find).
    pub fn choose(&self, name: Option<&str>) -> Result<&E> {
        match (name, self.entries.first()) {
            (None, Some(first)) => Ok(first),
            (name, _) => self.find(name.unwrap_or_default()),
        }
    }

    /// Adds a plugin of one's own, after the built-in ones: it never becomes a default, and is
    /// chosen by its name.
    ///
    /// # Errors
    /// [`Error::Usage`] if the name is taken.
    pub fn add(&mut self, entry: E) -> Result<()> {
        if self.entries.iter().any(|e| e.name() == entry.name()) {
            return Err(Error::Usage(format!(
                "{} '{}' exists already; choose another name",
                E::KIND,
                entry.name()
            )));
        }
        self.entries.push(entry);
        Ok(())
    }
}

/// Implements [`Entry`] for a struct with the fields `name` and `doc`.
macro_rules! impl_entry {
    ($type:ty, $kind:literal) => {
        impl crate::registry::Entry for $type {
            const KIND: &'static str = $kind;
            fn name(&self) -> &'static str {
                self.name
            }
            fn doc(&self) -> &'static str {
                self.doc
            }
        }
    };
}
pub(crate) use impl_entry;
