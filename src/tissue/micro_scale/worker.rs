//! The scratch memory of one thread.

use super::library::Library;
use crate::fiber::workspace::Workspace;
use crate::las::{Backend, RealBackend, SolveError};

/// The workspaces of one thread: one for every model that it has solved so far.
pub(super) struct Worker<B: Backend> {
    workspaces: Vec<Option<Workspace<B>>>,
}

impl<B: RealBackend> Worker<B> {
    pub fn new(models: usize) -> Self {
        Self { workspaces: (0..models).map(|_| None).collect() }
    }

    /// Returns the workspace of a model, which the first call creates.
    pub fn workspace(&mut self, library: &Library<B>, model: usize) -> Result<&mut Workspace<B>, SolveError<B::Error>> {
        let place = &mut self.workspaces[model];
        match place {
            Some(workspace) => Ok(workspace),
            None => Ok(place.insert(Workspace::new(&library.context, &library.models[model])?)),
        }
    }
}
