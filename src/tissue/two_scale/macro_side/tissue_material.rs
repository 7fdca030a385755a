//! What a run needs of the body's material beyond stresses and tangents, with the RVEs on other ranks.

use std::collections::HashSet;
use std::path::Path;
use std::sync::PoisonError;

use super::super::TwoScaleError;
use super::super::balance::BalanceReport;
use super::super::micro_proxy::{BodySolve, MicroProxy};
use super::super::piece_messages::PieceFailure;
use super::super::progress::ProgressReceiver;
use super::super::protocol::RankTimes;
use super::ScaleField;
use crate::coupling::UnitId;
use crate::fem::mesh::Mesh;
use crate::las::{Comm, RealBackend};
use crate::tissue::micro_scale::{
    DeformedNetwork, FailedRve, FieldRestoreError, Library, Piece, PieceError, PointSummary, ProgressSource, RveCost,
    RveCounts, RveStats, SavedSites, Sites, TissueFieldError, TissueMaterial, check_count,
};

impl<C: Comm, B: RealBackend> TissueMaterial for ScaleField<'_, C, B> {
    type Micro = B;

    fn library(&self) -> &Library<B> {
        &self.library
    }

    fn sites(&self) -> &Sites {
        &self.sites
    }

    fn forget_other_points(&mut self) {
        if self.divided.is_some() {
            let points = self.sites.points();
            let mut own: Vec<usize> = (0..points.len()).map(|point| points.in_whole(point)).collect();
            own.sort_unstable();
            self.library.keep_points(&own);
        }
    }

    fn rve_counts(&self) -> RveCounts {
        match &self.divided {
            None => self.sites.counts(self.library.models().len(), |_| true),
            Some(divided) => divided.counts.clone(),
        }
    }

    fn rve_bytes(&self) -> usize {
        self.reports.bytes
    }

    fn take_stats(&self) -> RveStats {
        std::mem::take(&mut self.reports.stats.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_times(&self) -> Vec<Vec<RankTimes>> {
        std::mem::take(&mut self.reports.times.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_balance(&self) -> BalanceReport {
        std::mem::take(&mut self.reports.balance.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn take_costs(&self) -> Vec<Vec<RveCost>> {
        std::mem::take(&mut self.reports.costs.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn share_at_nodes(&self, mesh: &Mesh, width: usize, values: &mut [f64]) -> Result<(), TissueFieldError> {
        let (Some(divided), Some(part)) = (&self.divided, mesh.part()) else { return Ok(()) };
        Ok(self.record_error(divided.share_at_nodes(mesh, part, width, values))?)
    }

    fn progress_source(&self) -> Option<ProgressSource> {
        self.progress.as_ref().map(ProgressReceiver::source)
    }

    fn take_failed_rve(&self) -> Option<FailedRve> {
        self.failed_rve.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn summaries(&self) -> Vec<Option<PointSummary>> {
        self.reports.summaries.clone()
    }

    fn deformed_network(&self, point: usize) -> Option<DeformedNetwork> {
        self.reports.networks.get(&(point as UnitId)).cloned()
    }

    fn ranks(&self) -> [usize; 2] {
        [self.micro.scales.comm().size(), self.micro.ranks().len()]
    }

    fn shards(&self) -> Option<(&[u32], usize)> {
        let shards = self.micro.scales.comm().size();
        self.micro.shard_of.as_deref().filter(|_| shards > 1).map(|shard_of| (shard_of, shards))
    }

    /// Orders the nodes by rank if all ranks solve: the rows of a rank are then mostly those of its own elements.
    fn node_order(&self, mesh: &Mesh) -> Vec<u32> {
        let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
        if let (BodySolve::Distributed, Some(shard_of)) = (self.micro.body_solve, &self.micro.shard_of) {
            let mut rank_of_node = vec![u32::MAX; order.len()];
            for (nodes, &rank) in mesh.elements().iter().zip(shard_of) {
                nodes.iter().for_each(|&node| rank_of_node[node as usize] = rank_of_node[node as usize].min(rank));
            }
            order.sort_by_key(|&node| rank_of_node[node as usize]);
        }
        order
    }

    fn rank_of(&self, point: usize) -> usize {
        self.rank_of[point] as usize
    }

    fn save_units(&self, folder: &Path, stem: &str) -> Result<Vec<Piece>, PieceError> {
        let saved = self.on_pieces(folder, |micro| micro.save(folder, stem))?;
        Ok(saved.into_iter().flatten().collect())
    }

    fn verify_pieces(&self, folder: &Path, pieces: &[Piece]) -> Result<(), PieceError> {
        self.on_pieces(folder, |micro| micro.verify(folder, pieces)).map(drop)
    }

    fn restore_units(&mut self, sites: &SavedSites, folder: &Path, pieces: &[Piece]) -> Result<(), FieldRestoreError> {
        let before: HashSet<usize> = self.sites.existing().map(|(point, _)| point).collect();
        let restored = self.sites.restore(sites);
        let failed = self.record_error(self.any([restored.is_err()]));
        let [failed] = failed.map_err(|error| FieldRestoreError::Ranks(error.to_string()))?;
        restored?;
        if failed {
            return Err(FieldRestoreError::Ranks("the state does not match the part of another rank".into()));
        }
        self.check_count(pieces)?;
        let existing: Vec<usize> = self.sites.existing().map(|(point, _)| point).collect();
        let now: HashSet<usize> = existing.iter().copied().collect();
        let mut deleted: Vec<usize> = before.difference(&now).copied().collect();
        deleted.sort_unstable();
        let created: Vec<usize> = existing.into_iter().filter(|point| !before.contains(point)).collect();
        let updated = self.exchange_update(&deleted, &created);
        let restored = updated.and_then(|()| self.micro.restore(folder, pieces));
        let restored = self.record_error(restored).map_err(|error| FieldRestoreError::Ranks(error.to_string()))?;
        restored.into_iter().collect::<Result<(), String>>().map_err(FieldRestoreError::Ranks)
    }
}

impl<C: Comm, B: RealBackend> ScaleField<'_, C, B> {
    /// Checks that pieces hold as many RVEs as exist on all ranks.
    fn check_count(&self, pieces: &[Piece]) -> Result<(), FieldRestoreError> {
        let own = self.sites.existing().filter(|(point, _)| self.is_own(*point)).count();
        let existing = match &self.divided {
            None => own,
            Some(divided) => {
                let counts = self.record_error(divided.gather(&[own as f64]));
                let counts = counts.map_err(|error| FieldRestoreError::Ranks(error.to_string()))?;
                counts.iter().sum::<f64>() as usize
            }
        };
        check_count(existing, pieces)
    }

    /// Makes the ranks of the micro scale write or verify pieces; returns the values of all ranks, or the error of the
    /// first rank that has one.
    fn on_pieces<T>(
        &self,
        folder: &Path,
        command: impl FnOnce(&MicroProxy<'_, C>) -> Result<Vec<Result<T, PieceFailure>>, TwoScaleError>,
    ) -> Result<Vec<T>, PieceError> {
        if let Some(reason) = self.broken.get() {
            return Err(PieceError::Ranks(reason.clone()));
        }
        let answers = self.record_error(command(&self.micro));
        let answers = answers.map_err(|error| PieceError::Ranks(error.to_string()))?;
        answers.into_iter().collect::<Result<_, _>>().map_err(|failure: PieceFailure| failure.in_folder(folder))
    }
}
