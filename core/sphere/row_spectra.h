#pragma once

// The first half of the harmonic transform: the Fourier integrals of every row of a lat-long image.

#include <cstddef>
#include <vector>

#include "core/base/progress.h"
#include "core/image/image.h"
#include "core/sphere/fourier.h"

namespace lightkiln {

// Rows j and H-1-j mirror each other: P_lm(-z) = (-1)^(l+m) P_lm(z), so their sum meets the even
// l+m and their difference the odd ones, and one Legendre value serves both.
inline constexpr int kRowVectors = 4;                   // of kLanes row pairs
inline constexpr int kRowPairs = kRowVectors * kLanes;  // row pairs in a block
inline constexpr size_t kRowBlock = 12 * kRowVectors;   // Lanes per (order, block)

// For order m and block b: kRowBlock Lanes, [(slot * kRowVectors) + vector], slot 0..5 the cosine
// R, G, B and sine R, G, B integrals of north plus south, 6..11 those of north minus south. A row's
// integral is the exact int f(phi) e^{i m phi} dphi of texels that are constant over their width.
struct RowSpectra {
  int orders = 0, blocks = 0;
  std::vector<Lanes> values;
  Lanes* at(int m, int b) {
    return &values[(static_cast<size_t>(m) * static_cast<size_t>(blocks) + static_cast<size_t>(b)) *
                   kRowBlock];
  }
  const Lanes* at(int m, int b) const { return const_cast<RowSpectra*>(this)->at(m, b); }
};

// How rows are summed. Both give the same integrals to a relative 1e-14 of the row's mean.
enum class RowMethod {
  automatic,  // whichever is cheaper for the number of orders
  direct,     // sums against cosines and sines, quarters of a row folded; widths divisible by 4
  fourier,    // fast Fourier transforms of whole rows, any width
};

// Up to this many orders direct sums cost less than a transform; 0 when the width forbids them.
int direct_row_orders(int width);

// Orders m < `orders` of an RGB image. The same bits for any number of threads. Reports progress
// from 0 to 0.5.
RowSpectra row_spectra(const Image& image, int orders, int threads, Progress& progress,
                       RowMethod method = RowMethod::automatic);

}  // namespace lightkiln
