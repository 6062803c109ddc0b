#include "kernel/numerics/banded.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "base/contract.h"

namespace angiospline {

BandedCholesky::BandedCholesky(int size, int width)
    : size_(size),
      width_(width),
      band_(static_cast<std::size_t>(size) * static_cast<std::size_t>(width), 0.0) {
  EXPECTS(size >= 1 && width >= 1);
}

BandedCholesky BandedCholesky::gram(const CompactRows& A, const Eigen::VectorXd& weights) {
  EXPECTS(weights.size() == 0 || weights.size() == A.rows());
  BandedCholesky N(A.columns(), A.width());
  for (int r = 0; r < A.rows(); ++r) {
    const double* a = A.row(r);
    const double w = weights.size() == 0 ? 1.0 : weights(r);
    for (int i = 0; i < A.width(); ++i) {
      const double scaled = w * a[i];
      if (scaled == 0) continue;
      for (int j = 0; j <= i; ++j) N.at(A.first(r) + i, A.first(r) + j) += scaled * a[j];
    }
  }
  return N;
}

// l_ij = (a_ij - sum over k < j of l_ik l_jk) / l_jj, and the same sum for the diagonal.
double BandedCholesky::eliminate(int i) {
  double* row = band_.data() + static_cast<std::ptrdiff_t>(i) * width_;
  const int low = std::max(0, i - width_ + 1);
  for (int j = low; j < i; ++j) {
    const double* other = band_.data() + static_cast<std::ptrdiff_t>(j) * width_;
    double sum = row[i - j];
    for (int k = std::max(low, j - width_ + 1); k < j; ++k) sum -= row[i - k] * other[j - k];
    row[i - j] = sum / other[0];
  }

  double square = row[0];
  for (int k = low; k < i; ++k) square -= row[i - k] * row[i - k];
  return square;
}

int BandedCholesky::factor() {
  constexpr double kRounding = 64 * std::numeric_limits<double>::epsilon();
  for (int i = 0; i < size_; ++i) {
    const double diagonal = at(i, i);
    const double square = eliminate(i);
    if (!(square > kRounding * diagonal)) return i;
    at(i, i) = std::sqrt(square);
  }
  return -1;
}

void BandedCholesky::factor_with_ridge(double ridge) {
  EXPECTS(ridge >= 0);
  for (int i = 0; i < size_; ++i) {
    at(i, i) += ridge;
    at(i, i) = std::sqrt(std::max(eliminate(i), ridge));
  }
}

void BandedCholesky::solve(Eigen::Ref<Eigen::MatrixXd> x) const {
  EXPECTS(x.rows() == size_);
  for (Eigen::Index c = 0; c < x.cols(); ++c) {
    double* y = x.col(c).data();
    for (int i = 0; i < size_; ++i) {
      const double* row = band_.data() + static_cast<std::ptrdiff_t>(i) * width_;
      double sum = y[i];
      for (int k = std::max(0, i - width_ + 1); k < i; ++k) sum -= row[i - k] * y[k];
      y[i] = sum / row[0];
    }
    for (int i = size_ - 1; i >= 0; --i) {
      const double* row = band_.data() + static_cast<std::ptrdiff_t>(i) * width_;
      y[i] /= row[0];
      for (int k = std::max(0, i - width_ + 1); k < i; ++k) y[k] -= row[i - k] * y[i];
    }
  }
}

void BandedCholesky::solve_blocks(double* x, int stride) const {
  const auto block = [&](int i) { return x + static_cast<std::ptrdiff_t>(i) * stride; };
  const auto row_of = [&](int i) { return band_.data() + static_cast<std::ptrdiff_t>(i) * width_; };
  for (int i = 0; i < size_; ++i) {
    double* y = block(i);
    for (int k = std::max(0, i - width_ + 1); k < i; ++k) {
      const double factor = row_of(i)[i - k];
      const double* other = block(k);
      for (int c = 0; c < stride; ++c) y[c] -= factor * other[c];
    }
    const double pivot = row_of(i)[0];
    for (int c = 0; c < stride; ++c) y[c] /= pivot;
  }

  for (int i = size_ - 1; i >= 0; --i) {
    double* y = block(i);
    const double pivot = row_of(i)[0];
    for (int c = 0; c < stride; ++c) y[c] /= pivot;
    for (int k = std::max(0, i - width_ + 1); k < i; ++k) {
      const double factor = row_of(i)[i - k];
      double* other = block(k);
      for (int c = 0; c < stride; ++c) other[c] -= factor * y[c];
    }
  }
}

bool factorise_band(SymmetricBand& A) {
  const Eigen::Index n = A.cols();
  const Eigen::Index p = A.rows() - 1;
  for (Eigen::Index j = 0; j < n; ++j) {
    if (!(A(0, j) > 0)) return false;
    const double pivot = std::sqrt(A(0, j));
    const Eigen::Index below = std::min(p, n - 1 - j);
    A(0, j) = pivot;
    for (Eigen::Index k = 1; k <= below; ++k) A(k, j) /= pivot;
    for (Eigen::Index a = 1; a <= below; ++a) {
      for (Eigen::Index b = a; b <= below; ++b) A(b - a, j + a) -= A(a, j) * A(b, j);
    }
  }
  return true;
}

void solve_band(const SymmetricBand& L, Eigen::MatrixXd& B) {
  const Eigen::Index n = L.cols();
  const Eigen::Index p = L.rows() - 1;
  for (Eigen::Index j = 0; j < n; ++j) {
    B.row(j) /= L(0, j);
    for (Eigen::Index k = 1; k <= std::min(p, n - 1 - j); ++k) B.row(j + k) -= L(k, j) * B.row(j);
  }
  for (Eigen::Index j = n; j-- > 0;) {
    for (Eigen::Index k = 1; k <= std::min(p, n - 1 - j); ++k) B.row(j) -= L(k, j) * B.row(j + k);
    B.row(j) /= L(0, j);
  }
}

CyclicCholesky::CyclicCholesky(int size, int width)
    : main_(size >= 2 * width ? size - width + 1 : 0),
      border_(size - main_),
      band_(std::max(main_, 1), width),
      corner_(Eigen::MatrixXd::Zero(border_, border_)),
      coupling_(Eigen::MatrixXd::Zero(border_, main_)) {}

void CyclicCholesky::add(int i, int j, double value) {
  if (i < j) std::swap(i, j);
  if (i < main_) {
    band_.at(i, j) += value;
  } else if (j >= main_) {
    corner_(i - main_, j - main_) += value;
  } else {
    coupling_(i - main_, j) += value;
  }
}

bool CyclicCholesky::factor() {
  if (main_ > 0) {
    if (band_.factor() >= 0) return false;
    solved_ = coupling_.transpose();
    band_.solve(solved_);
    corner_ -= coupling_ * solved_;
  }
  Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> in_place(corner_);
  return in_place.info() == Eigen::Success;
}

void CyclicCholesky::solve_blocks(double* x, int stride) const {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<Rows> head(x, main_, stride);
  Eigen::Map<Rows> tail(x + static_cast<std::ptrdiff_t>(main_) * stride, border_, stride);
  if (main_ > 0) {
    band_.solve_blocks(x, stride);
    tail -= coupling_ * head;
  }
  const auto lower = corner_.triangularView<Eigen::Lower>();
  lower.solveInPlace(tail);
  lower.transpose().solveInPlace(tail);
  if (main_ > 0) head -= solved_ * tail;
}

int solve_totally_positive(const CompactRows& A, Eigen::Ref<Eigen::MatrixXd> b) {
  EXPECTS(A.rows() == A.columns() && b.rows() == A.rows());
  const int n = A.rows();
  const int w = A.width();
  // Row i of the working matrix holds columns i - w + 1 .. i + w - 1.
  const int stride = 2 * w - 1;
  std::vector<double> band(static_cast<std::size_t>(n) * static_cast<std::size_t>(stride), 0.0);
  const auto at = [&](int i, int j) -> double& {
    return band[static_cast<std::size_t>(i * stride + (j - i) + w - 1)];
  };

  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < w; ++k) {
      const int j = A.first(i) + k;
      if (A.row(i)[k] == 0) continue;
      if (std::abs(i - j) >= w) return i;  // Schoenberg-Whitney does not hold
      at(i, j) = A.row(i)[k];
    }
  }

  // Elimination without pivoting: minors of a totally positive matrix are not negative, so no entry
  // grows.
  for (int k = 0; k < n; ++k) {
    const double pivot = at(k, k);
    if (!(std::abs(pivot) > std::numeric_limits<double>::min())) return k;
    for (int i = k + 1; i < std::min(n, k + w); ++i) {
      if (at(i, k) == 0) continue;
      const double factor = at(i, k) / pivot;
      for (int j = k + 1; j < std::min(n, k + w); ++j) at(i, j) -= factor * at(k, j);
      b.row(i) -= factor * b.row(k);
    }
  }

  for (int k = n - 1; k >= 0; --k) {
    for (int j = k + 1; j < std::min(n, k + w); ++j) b.row(k) -= at(k, j) * b.row(j);
    b.row(k) /= at(k, k);
  }
  return -1;
}

}  // namespace angiospline
