//! The scratch memory of one thread.

use std::sync::Arc;

use super::library::Library;
use crate::fiber::equilibrium::StageInProgress;
use crate::fiber::workspace::Workspace;
use crate::las::{Backend, RealBackend, SolveError};

/// The workspaces of one thread: one for every model that it has solved so far.
pub(super) struct Worker<B: Backend> {
    workspaces: Vec<Option<Workspace<B>>>,
    /// The stage of the RVE that it is solving.
    stage: Arc<StageInProgress>,
}

impl<B: RealBackend> Worker<B> {
    pub fn new(models: usize) -> Self {
        Self { workspaces: (0..models).map(|_| None).collect(), stage: Arc::default() }
    }

    /// Returns the workspace of a model, which the first call creates.
    pub fn workspace(&mut self, library: &Library<B>, model: usize) -> Result<&mut Workspace<B>, SolveError<B::Error>> {
        let place = &mut self.workspaces[model];
        match place {
            Some(workspace) => Ok(workspace),
            None => {
                let workspace = place.insert(Workspace::new(&library.context, &library.models[model])?);
                workspace.report_stages(Arc::clone(&self.stage));
                Ok(workspace)
            }
        }
    }

    /// Returns the stage of the RVE that the thread is solving.
    pub fn stage(&self) -> &Arc<StageInProgress> {
        &self.stage
    }
}
