//! A cursor into the file's JSON that knows where it is, so that every error names the place, as
//! a JSON pointer (RFC 6901).

use std::borrow::Cow;

use serde_json::Value;

use super::Problem;

/// A JSON value with its path.
#[derive(Clone)]
pub(super) struct Cursor<'a> {
    value: &'a Value,
    path: String,
}

impl<'a> Cursor<'a> {
    /// The whole document.
    pub(super) fn root(value: &'a Value) -> Self {
        Self {
            value,
            path: String::new(),
        }
    }

    /// Where this is, for messages.
    pub(super) fn path(&self) -> &str {
        if self.path.is_empty() {
            "the document"
        } else {
            &self.path
        }
    }

    /// The value itself.
    pub(super) fn value(&self) -> &'a Value {
        self.value
    }

    /// Something is wrong here.
    pub(super) fn problem(&self, problem: impl Into<String>) -> Problem {
        Problem::invalid(self.path(), problem)
    }

    /// The member `key`; absent and `null` are the same.
    pub(super) fn get(&self, key: &str) -> Option<Self> {
        let value = self.value.get(key).filter(|v| !v.is_null())?;
        Some(Self {
            value,
            path: format!("{}/{}", self.path, escape(key)),
        })
    }

    /// The member `key`, which must be there.
    pub(super) fn need(&self, key: &str) -> Result<Self, Problem> {
        self.get(key)
            .ok_or_else(|| self.problem(format!("'{key}' is missing")))
    }

    /// The extension `name`.
    pub(super) fn extension(&self, name: &str) -> Option<Self> {
        self.get("extensions")?.get(name)
    }

    /// The elements of the array `key`; none if it is absent.
    pub(super) fn items(&self, key: &str) -> Result<Vec<Self>, Problem> {
        match self.get(key) {
            None => Ok(Vec::new()),
            Some(list) => list.elements(),
        }
    }

    /// The elements of this array.
    pub(super) fn elements(&self) -> Result<Vec<Self>, Problem> {
        let list = self
            .value
            .as_array()
            .ok_or_else(|| self.problem("is not an array"))?;
        Ok(list
            .iter()
            .enumerate()
            .map(|(i, value)| Self {
                value,
                path: format!("{}/{i}", self.path),
            })
            .collect())
    }

    /// Element `index` of the document's array `key`.
    pub(super) fn element(&self, key: &str, index: usize, from: &Self) -> Result<Self, Problem> {
        self.value
            .get(key)
            .and_then(|list| list.get(index))
            .map(|value| Self {
                value,
                path: format!("/{key}/{index}"),
            })
            .ok_or_else(|| from.problem(format!("/{key}/{index} does not exist")))
    }

    /// This number.
    pub(super) fn f64(&self) -> Result<f64, Problem> {
        self.value
            .as_f64()
            .filter(|x| x.is_finite())
            .ok_or_else(|| self.problem("is not a number"))
    }

    /// This index or count.
    pub(super) fn index(&self) -> Result<usize, Problem> {
        // Some exporters write whole numbers as 5.0.
        let whole = |x: f64| (0.0..=9e15).contains(&x) && x.fract() == 0.0;
        self.value
            .as_u64()
            .or_else(|| self.value.as_f64().filter(|x| whole(*x)).map(|x| x as u64))
            .and_then(|x| usize::try_from(x).ok())
            .ok_or_else(|| self.problem("is not a whole number from 0"))
    }

    /// This string.
    pub(super) fn str(&self) -> Result<&'a str, Problem> {
        self.value
            .as_str()
            .ok_or_else(|| self.problem("is not a string"))
    }

    /// The number `key`, or a default.
    pub(super) fn number_or(&self, key: &str, default: f64) -> Result<f64, Problem> {
        self.get(key).map_or(Ok(default), |c| c.f64())
    }

    /// The index or count `key`, or a default.
    pub(super) fn index_or(&self, key: &str, default: usize) -> Result<usize, Problem> {
        self.get(key).map_or(Ok(default), |c| c.index())
    }

    /// The flag `key`, or `false`.
    pub(super) fn flag(&self, key: &str) -> bool {
        self.get(key)
            .and_then(|c| c.value.as_bool())
            .unwrap_or(false)
    }

    /// The `N` numbers of `key`, or a default.
    pub(super) fn numbers_or<const N: usize>(
        &self,
        key: &str,
        default: [f64; N],
    ) -> Result<[f64; N], Problem> {
        let Some(list) = self.get(key) else {
            return Ok(default);
        };
        let items = list.elements()?;
        if items.len() < N {
            return Err(list.problem(format!("has {} numbers, {N} are needed", items.len())));
        }
        let mut out = default;
        for (o, item) in out.iter_mut().zip(&items) {
            *o = item.f64()?;
        }
        Ok(out)
    }

    /// The name given here, or `kind` with its place.
    pub(super) fn name(&self) -> String {
        self.get("name")
            .and_then(|n| n.value.as_str())
            .filter(|n| !n.is_empty())
            .map_or_else(|| self.path.clone(), str::to_owned)
    }
}

/// A key as a part of a JSON pointer.
fn escape(key: &str) -> Cow<'_, str> {
    if key.contains(['~', '/']) {
        Cow::Owned(key.replace('~', "~0").replace('/', "~1"))
    } else {
        Cow::Borrowed(key)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

    use super::*;
    use serde_json::json;

    #[test]
    fn paths_are_json_pointers() {
        let v = json!({"a/b": [{"c~d": 1}]});
        let at = Cursor::root(&v).get("a/b").unwrap().elements().unwrap();
        let at = at[0].get("c~d").unwrap();
        assert_eq!(at.path(), "/a~1b/0/c~0d");
        assert_eq!(v.pointer(at.path()), Some(at.value()));
    }
}
