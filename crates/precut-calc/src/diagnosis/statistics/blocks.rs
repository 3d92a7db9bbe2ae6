//! Free columns of which each acts on the rows of one block only, as those of one run do (`diagnosis/3.5`).
//!
//! Beside causes X, free columns K and allowances N the posterior is that of [X K N] with sizes of their own each:
//! |I + [X K]'C^-1[X K]| is |I + [X K N]'[X K N]| over |I + N'N|, sizes and square are the same. That matrix couples a block
//! to nothing but to what all blocks share, X and some of N: its factor takes time in proportion to the number
//! of blocks, where the other one takes the cube of it.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::diagnosis::rows::basis::dot;
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::evidence::{Scale, Side, log_det, one_sided};
use crate::diagnosis::statistics::whiten::{White, Whitener};

/// Free columns block by block.
pub(in crate::diagnosis) struct Blocks {
    each: Vec<Block>,
    /// Allowances that act on several blocks.
    shared: Vec<Sparse>,
    /// ln |I + N'N|.
    log_det_allowances: f64,
    columns: usize,
    rows: f64,
}

struct Block {
    /// Numbers of its columns among all.
    columns: Vec<usize>,
    /// These, and the allowances that act here alone; whitened but for the allowances.
    own: Vec<Sparse>,
    gram: DMatrix<f64>,
}

impl Blocks {
    /// `None` where all columns hang together.
    pub(in crate::diagnosis) fn of(columns: &[Sparse], whitener: &Whitener) -> Option<Self> {
        let log_det_allowances = whitener.log_det_allowances()?;
        let own: Vec<Sparse> = columns.iter().map(|column| whitener.sparse(column)).collect();
        let mut together = Together { first: (0..own.len()).collect(), of_row: Vec::new() };
        own.iter().enumerate().for_each(|(index, column)| together.add(index, column));
        let mut members: Vec<Vec<usize>> = vec![Vec::new(); own.len()];
        (0..own.len()).for_each(|index| members[together.root(index)].push(index));
        if members.iter().filter(|members| !members.is_empty()).count() < 2 {
            return None;
        }
        let mut alone: Vec<Vec<&Sparse>> = vec![Vec::new(); own.len()];
        let mut shared = Vec::new();
        for nuisance in whitener.nuisances() {
            match together.only(nuisance) {
                Some(block) => alone[block].push(nuisance),
                None => shared.push(nuisance.clone()),
            }
        }
        let each = members.into_iter().zip(alone).filter(|(columns, _)| !columns.is_empty()).map(|(columns, alone)| {
            let own: Vec<Sparse> = columns.iter().map(|&index| &own[index]).chain(alone).cloned().collect();
            let gram = DMatrix::from_fn(own.len(), own.len(), |i, j| own[i].inner(&own[j]));
            Block { columns, own, gram }
        });
        let each = each.collect();
        Some(Self { each, shared, log_det_allowances, columns: columns.len(), rows: whitener.rows() })
    }

    /// With causes that explain a residual.
    pub(in crate::diagnosis) fn beside<'a>(&'a self, causes: &[&White], residual: &White) -> Beside<'a> {
        let (count, residual) = (causes.len(), residual.own());
        let border = count + self.shared.len();
        let coupled = |column: &Sparse, j: usize| {
            if j < count { column.dot(causes[j].own()) } else { column.inner(&self.shared[j - count]) }
        };
        let mut gram = DMatrix::zeros(border, border);
        for i in 0..border {
            for j in 0..=i {
                let product =
                    if i < count { dot(causes[i].own(), causes[j].own()) } else { coupled(&self.shared[i - count], j) };
                gram[(i, j)] = product;
                gram[(j, i)] = product;
            }
        }
        let along =
            |i: usize| if i < count { dot(causes[i].own(), residual) } else { self.shared[i - count].dot(residual) };
        let of_block = |block: &Block| Products {
            with_border: DMatrix::from_fn(block.own.len(), border, |i, j| coupled(&block.own[i], j)),
            right: DVector::from_iterator(block.own.len(), block.own.iter().map(|column| column.dot(residual))),
        };
        Beside {
            blocks: self,
            causes: count,
            of_blocks: self.each.iter().map(of_block).collect(),
            gram,
            right: DVector::from_fn(border, |i, _| along(i)),
            square: dot(residual, residual),
        }
    }
}

/// Which columns share rows.
struct Together {
    /// Of every column another of its block that came before, or itself.
    first: Vec<usize>,
    /// Of every row a column that acts there.
    of_row: Vec<Option<usize>>,
}

impl Together {
    fn root(&self, mut column: usize) -> usize {
        while self.first[column] != column {
            column = self.first[column];
        }
        column
    }

    fn add(&mut self, index: usize, column: &Sparse) {
        let mut own = index;
        for &row in column.rows() {
            if row >= self.of_row.len() {
                self.of_row.resize(row + 1, None);
            }
            if let Some(other) = self.of_row[row].map(|other| self.root(other)).filter(|other| *other != own) {
                let (low, high) = (own.min(other), own.max(other));
                self.first[high] = low;
                own = low;
            }
            self.of_row[row] = Some(own);
        }
    }

    /// The one block on whose rows alone something acts.
    fn only(&self, column: &Sparse) -> Option<usize> {
        let mut blocks =
            column.rows().iter().map(|&row| self.of_row.get(row).copied().flatten().map(|index| self.root(index)));
        let first = blocks.next().flatten()?;
        blocks.all(|block| block == Some(first)).then_some(first)
    }
}

/// Inner products of free columns with a set of causes and with what both are to explain.
pub(in crate::diagnosis) struct Beside<'a> {
    blocks: &'a Blocks,
    causes: usize,
    of_blocks: Vec<Products>,
    /// Of the causes and the shared allowances among each other, and with the residual.
    gram: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
}

/// Inner products of the columns of a block.
struct Products {
    /// With the causes and the shared allowances.
    with_border: DMatrix<f64>,
    /// With the residual.
    right: DVector<f64>,
}

/// The factor of the whole matrix.
struct Factored {
    of_blocks: Vec<FactoredBlock>,
    border: Cholesky<f64, Dyn>,
    /// What blocks leave to the border to explain.
    right: DVector<f64>,
}

struct FactoredBlock {
    own: Cholesky<f64, Dyn>,
    /// What couples it to the border.
    coupled: DMatrix<f64>,
    /// What it explains by itself.
    half: DVector<f64>,
}

impl Beside<'_> {
    /// Evidence with the free columns scaled, and the sizes of causes and free columns.
    pub(in crate::diagnosis) fn evidence(
        &self,
        scales: &[f64],
        sides: &[Side],
        scale: Scale,
    ) -> Option<(f64, Vec<f64>)> {
        let Factored { of_blocks, border, right } = self.factored(scales)?;
        let of_border = border.solve(&right);
        let by_blocks: f64 = of_blocks.iter().map(|block| block.half.norm_squared()).sum();
        let q = (self.square - by_blocks - right.dot(&of_border)).max(0.0);
        let log_det_blocks: f64 = of_blocks.iter().map(|block| log_det(&block.own)).sum();
        let log_det = log_det_blocks + log_det(&border) - self.blocks.log_det_allowances;
        let mut t: Vec<f64> = of_border.iter().copied().take(self.causes).collect();
        t.resize(self.causes + self.blocks.columns, 0.0);
        for (block, FactoredBlock { own, coupled, half }) in self.blocks.each.iter().zip(&of_blocks) {
            let sizes = own.l_dirty().tr_solve_lower_triangular(&(half - coupled * &of_border))?;
            block.columns.iter().zip(&sizes).for_each(|(&column, size)| t[self.causes + column] = *size);
        }
        let log_z = scale.log_likelihood(q, self.blocks.rows) - 0.5 * log_det + one_sided(sides, &t, &border.inverse());
        Some((log_z, t))
    }

    /// Posterior standard deviation of the sum of the scaled columns at every row.
    pub(in crate::diagnosis) fn deviation(&self, scales: &[f64], columns: &[Sparse], rows: usize) -> Option<Vec<f64>> {
        let factored = self.factored(scales)?;
        let of_row = |row: usize| {
            let (mut square, mut on_border) = (0.0, DVector::zeros(self.gram.nrows()));
            for (block, FactoredBlock { own, coupled, .. }) in self.blocks.each.iter().zip(&factored.of_blocks) {
                let of =
                    |i: usize| block.columns.get(i).map_or(0.0, |&column| columns[column].at(row) * scales[column]);
                let along = DVector::from_fn(block.own.len(), |i, _| of(i));
                if along.amax() > 0.0 {
                    let half = own.l_dirty().solve_lower_triangular(&along)?;
                    square += half.norm_squared();
                    on_border += coupled.tr_mul(&half);
                }
            }
            let half = factored.border.l_dirty().solve_lower_triangular(&on_border)?;
            Some((square + half.norm_squared()).sqrt())
        };
        (0..rows).map(of_row).collect()
    }

    fn factored(&self, scales: &[f64]) -> Option<Factored> {
        let mut border = self.gram.clone();
        (0..border.nrows()).for_each(|i| border[(i, i)] += 1.0);
        let mut right = self.right.clone();
        let mut of_blocks = Vec::with_capacity(self.of_blocks.len());
        for (block, products) in self.blocks.each.iter().zip(&self.of_blocks) {
            // Allowances have their scale.
            let scale = |i: usize| block.columns.get(i).map_or(1.0, |&column| scales[column]);
            let count = block.own.len();
            let own = Cholesky::new(DMatrix::from_fn(count, count, |i, j| {
                block.gram[(i, j)] * scale(i) * scale(j) + f64::from(u8::from(i == j))
            }))?;
            let coupled = DMatrix::from_fn(count, border.ncols(), |i, j| products.with_border[(i, j)] * scale(i));
            let coupled = own.l_dirty().solve_lower_triangular(&coupled)?;
            let half = DVector::from_fn(count, |i, _| products.right[i] * scale(i));
            let half = own.l_dirty().solve_lower_triangular(&half)?;
            border -= coupled.tr_mul(&coupled);
            right -= coupled.tr_mul(&half);
            of_blocks.push(FactoredBlock { own, coupled, half });
        }
        Some(Factored { of_blocks, border: Cholesky::new(border)?, right })
    }
}
