#include "ricochet/faults/fault_stiffness.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "fault_fft.hpp"
#include "stiffness_data.hpp"
#ifdef RICOCHET_WITH_FFTW
#include "fftw_product.hpp"
#endif

namespace ricochet {

namespace {

using detail::ComplexPair;
using detail::Pair;
using detail::PairedTransform;
using detail::StiffnessData;

/// The least number of at least 2 n - 1 without factors above 5, for which transforms are fast.
int length_for(int n)
{
    for (int length = std::max(2, 2 * n - 1);; ++length) {
        int rest = length;
        for (const int factor : {2, 3, 5}) {
            while (rest % factor == 0) rest /= factor;
        }
        if (rest == 1) return length;
    }
}

std::vector<double> cosines(int length)
{
    std::vector<double> out(static_cast<std::size_t>(length));
    for (int i = 0; i < length; ++i) {
        out[static_cast<std::size_t>(i)] = std::cos(2 * std::numbers::pi * i / length);
    }
    return out;
}

/// Transforms the rows of `entries`, even sequences of n distances, for the frequencies 0 ..
/// length / 2: sum over |d| < n of entries(., |d|) cos(2 pi k d / length).
Eigen::MatrixXd even_transform(const Eigen::MatrixXd& entries, int length)
{
    const auto table = cosines(length);
    const Eigen::Index n = entries.cols();
    Eigen::MatrixXd basis(n, length / 2 + 1);
    for (Eigen::Index k = 0; k < basis.cols(); ++k) {
        for (Eigen::Index d = 0; d < n; ++d) {
            const auto angle = static_cast<std::size_t>((k * d) % length);
            basis(d, k) = (d == 0 ? 1 : 2) * table[angle];
        }
    }
    return entries * basis;
}

}  // namespace

namespace detail {

/// Two rows of a field as one complex number: x + i y, y = 0 beyond the last row.
class StiffnessTransforms {
public:
    explicit StiffnessTransforms(const StiffnessData& data)
        : d_(data), fft_(data.length), blocks_((data.n + 3) / 4)
    {
        const auto length = static_cast<std::size_t>(d_.length);
        rows_.resize(static_cast<std::size_t>(blocks_) * length);
        // A block of rows may extend beyond the end of the circle.
        const auto longest = std::max(length, static_cast<std::size_t>(4 * blocks_));
        a_.resize(longest);
        b_.resize(longest);
        // FFT plans are made at first use: force this here, not in the first product.
        fft_.forward(b_.data(), a_.data());
        fft_.inverse(a_.data(), b_.data());
#ifdef RICOCHET_WITH_FFTW
        if (d_.form == StiffnessData::Form::toeplitz) fftw_ = std::make_unique<FftwProduct>(d_);
#endif
        if (d_.form == StiffnessData::Form::layered) {
            x_.resize(d_.n, 4);
            y_.resize(d_.n, 4);
        }
    }

    void multiply(const double* x, double* y, double factor)
    {
#ifdef RICOCHET_WITH_FFTW
        if (fftw_) return fftw_->multiply(x, y, factor);
#endif
        for (int block = 0; block < blocks_; ++block) transform_rows(x, block);
        for (int k = 0; k < d_.frequencies(); k += 2) {
            if (d_.form == StiffnessData::Form::toeplitz) {
                convolve(k);
            } else {
                mix_layers(k);
            }
        }
        for (int block = 0; block < blocks_; ++block) restore_rows(y, block, factor);
    }

private:
    /// Rows 4 b .. 4 b + 3: (0) + i (1) and (2) + i (3), side by side.
    void transform_rows(const double* x, int block)
    {
        const int n = d_.n;
        const double* row[4];
        for (int r = 0; r < 4; ++r) {
            const int at = std::min(4 * block + r, n - 1);
            row[r] = x + static_cast<std::ptrdiff_t>(at) * n;
        }
        const int there = n - 4 * block;  // rows of the block that exist
        for (int i = 0; i < n; ++i) {
            const auto at = static_cast<std::size_t>(i);
            a_[at] = ComplexPair(Pair(row[0][i], there > 2 ? row[2][i] : 0),
                                 Pair(there > 1 ? row[1][i] : 0, there > 3 ? row[3][i] : 0));
        }
        std::fill(a_.begin() + n, a_.end(), ComplexPair(Pair(0.0), Pair(0.0)));
        fft_.forward(row_of(block), a_.data());
    }

    void restore_rows(double* y, int block, double factor)
    {
        const int n = d_.n;
        fft_.inverse(a_.data(), row_of(block));
        const int there = std::min(4, n - 4 * block);
        for (int i = 0; i < n; ++i) {
            const ComplexPair& z = a_[static_cast<std::size_t>(i)];
            const double value[4] = {z.real().v[0], z.imag().v[0], z.real().v[1], z.imag().v[1]};
            for (int r = 0; r < there; ++r) {
                y[static_cast<std::ptrdiff_t>(4 * block + r) * n + i] = factor * value[r];
            }
        }
    }

    /// The spectra of rows r, r + 1 at frequency k, doubled, from those of x_r + i x_{r+1}.
    /// Frequencies k and k + 1 are processed together as a pair, if the second exists.
    void gather(int k, int block, std::size_t lane, ComplexPair* out) const
    {
        const ComplexPair* row = row_of(block);
        double re[2][2] = {};
        double im[2][2] = {};
        for (int which = 0; which < 2; ++which) {
            const int at = k + which;
            if (at >= d_.frequencies()) break;
            const ComplexPair& f = row[at];
            const ComplexPair& g = row[at == 0 ? 0 : d_.length - at];
            const double fr = f.real().v[lane], fi = f.imag().v[lane];
            const double gr = g.real().v[lane], gi = g.imag().v[lane];
            re[0][which] = fr + gr;
            im[0][which] = fi - gi;
            re[1][which] = fi + gi;
            im[1][which] = gr - fr;
        }
        out[0] = ComplexPair(Pair(re[0][0], re[0][1]), Pair(im[0][0], im[0][1]));
        out[1] = ComplexPair(Pair(re[1][0], re[1][1]), Pair(im[1][0], im[1][1]));
    }

    /// The reverse: the spectrum of y_r + i y_{r+1}, of both signs of the frequency.
    void scatter(int k, int block, std::size_t lane, const ComplexPair& first,
                 const ComplexPair& second)
    {
        ComplexPair* row = row_of(block);
        for (int which = 0; which < 2; ++which) {
            const int at = k + which;
            if (at >= d_.frequencies()) break;
            const double fr = first.real().v[which], fi = first.imag().v[which];
            const double sr = second.real().v[which], si = second.imag().v[which];
            set(row[at], lane, fr - si, fi + sr);
            if (at != 0) set(row[d_.length - at], lane, fr + si, sr - fi);
        }
    }

    static void set(ComplexPair& z, std::size_t lane, double re, double im)
    {
        Pair r = z.real();
        Pair i = z.imag();
        r.v[lane] = re;
        i.v[lane] = im;
        z = ComplexPair(r, i);
    }

    void gather_column(int k)
    {
        for (int block = 0; block < blocks_; ++block) {
            gather(k, block, 0, &a_[static_cast<std::size_t>(4 * block)]);
            if (4 * block + 2 < d_.n)
                gather(k, block, 1, &a_[static_cast<std::size_t>(4 * block + 2)]);
        }
    }
    void scatter_column(int k)
    {
        for (int block = 0; block < blocks_; ++block) {
            const auto at = static_cast<std::size_t>(4 * block);
            scatter(k, block, 0, b_[at], b_[at + 1]);
            if (4 * block + 2 < d_.n) scatter(k, block, 1, b_[at + 2], b_[at + 3]);
        }
    }

    /// Frequencies k and k + 1 along x, convolved along depth.
    void convolve(int k)
    {
        gather_column(k);
        std::fill(a_.begin() + d_.n, a_.end(), ComplexPair(Pair(0.0), Pair(0.0)));
        fft_.forward(b_.data(), a_.data());
        const double* symbol = d_.symbol.data() + static_cast<std::ptrdiff_t>(k) *
                                                      static_cast<std::ptrdiff_t>(d_.length);
        for (std::size_t i = 0; i < static_cast<std::size_t>(d_.length); ++i) {
            const Pair s(symbol[2 * i], symbol[2 * i + 1]);
            b_[i] = ComplexPair(b_[i].real() * s, b_[i].imag() * s);
        }
        fft_.inverse(a_.data(), b_.data());
        a_.swap(b_);
        scatter_column(k);
    }

    void mix_layers(int k)
    {
        gather_column(k);
        for (int i = 0; i < d_.n; ++i) {
            const ComplexPair& z = a_[static_cast<std::size_t>(i)];
            x_.row(i) << z.real().v[0], z.imag().v[0], z.real().v[1], z.imag().v[1];
        }
        y_.leftCols<2>().noalias() = d_.layers[static_cast<std::size_t>(k)] * x_.leftCols<2>();
        if (k + 1 < d_.frequencies()) {
            y_.rightCols<2>().noalias() =
                d_.layers[static_cast<std::size_t>(k + 1)] * x_.rightCols<2>();
        }
        for (int i = 0; i < d_.n; ++i) {
            b_[static_cast<std::size_t>(i)] =
                ComplexPair(Pair(y_(i, 0), y_(i, 2)), Pair(y_(i, 1), y_(i, 3)));
        }
        scatter_column(k);
    }

    [[nodiscard]] ComplexPair* row_of(int block)
    {
        return rows_.data() + static_cast<std::ptrdiff_t>(block) * d_.length;
    }
    [[nodiscard]] const ComplexPair* row_of(int block) const
    {
        return rows_.data() + static_cast<std::ptrdiff_t>(block) * d_.length;
    }

    const StiffnessData& d_;
    PairedTransform fft_;
    int blocks_;  // of four rows
    std::vector<ComplexPair> rows_, a_, b_;
    Eigen::Matrix<double, Eigen::Dynamic, 4> x_, y_;
#ifdef RICOCHET_WITH_FFTW
    std::unique_ptr<FftwProduct> fftw_;
#endif
};

}  // namespace detail

// --- making K ---

namespace {

constexpr int small = 6;  // elements per side up to which K is stored

Eigen::MatrixXd stored(int elements, const FaultStiffness::ByDistance& entry)
{
    const Eigen::Index size = Eigen::Index{elements} * elements;
    Eigen::MatrixXd out(size, size);
    for (int i = 0; i < size; ++i) {
        for (int j = 0; j < size; ++j) {
            out(i, j) =
                entry(std::abs(i % elements - j % elements), std::abs(i / elements - j / elements));
        }
    }
    return out;
}

}  // namespace

FaultStiffness FaultStiffness::toeplitz(int elements, const ByDistance& entry)
{
    auto data = std::make_shared<StiffnessData>();
    data->form = StiffnessData::Form::toeplitz;
    data->n = elements;
    data->length = length_for(elements);
    Eigen::MatrixXd entries(elements, elements);  // (dz, dx)
    for (int dz = 0; dz < elements; ++dz) {
        for (int dx = 0; dx < elements; ++dx) entries(dz, dx) = entry(dx, dz);
    }
    const Eigen::MatrixXd by_x = even_transform(entries, data->length).transpose();
    const Eigen::MatrixXd both = even_transform(by_x, data->length);  // (kx, kz <= length / 2)
    data->upper = both.maxCoeff();
    if (elements <= small) data->matrix = stored(elements, entry);
    const auto length = static_cast<std::size_t>(data->length);
    const auto frequencies = static_cast<std::size_t>(data->frequencies());
    const double scale = 0.5 / (static_cast<double>(length) * static_cast<double>(length));
    data->symbol.assign((frequencies + 1) / 2 * 2 * length, 0.0);
    for (std::size_t k = 0; k < frequencies; ++k) {
        for (std::size_t i = 0; i < length; ++i) {
            const auto folded = static_cast<Eigen::Index>(std::min(i, length - i));
            data->symbol[(k - k % 2) * length + 2 * i + k % 2] =
                scale * both(static_cast<Eigen::Index>(k), folded);
        }
    }
    FaultStiffness out;
    out.data_ = std::move(data);
    return out;
}

FaultStiffness FaultStiffness::layered(int elements, const ByRows& entry)
{
    auto data = std::make_shared<StiffnessData>();
    data->form = StiffnessData::Form::layered;
    data->n = elements;
    data->length = length_for(elements);
    const Eigen::Index n = elements;
    data->layers.assign(static_cast<std::size_t>(data->frequencies()), Eigen::MatrixXd(n, n));
    Eigen::MatrixXd entries(n, n);  // (other row, dx)
    for (int row = 0; row < elements; ++row) {
        for (int other = 0; other <= row; ++other) {
            for (int dx = 0; dx < elements; ++dx) entries(other, dx) = entry(dx, row, other);
        }
        const Eigen::MatrixXd spectra = even_transform(entries.topRows(row + 1), data->length);
        for (Eigen::Index k = 0; k < spectra.cols(); ++k) {
            auto& layer = data->layers[static_cast<std::size_t>(k)];
            layer.row(row).head(row + 1) = spectra.col(k).transpose();
            layer.col(row).head(row + 1) = spectra.col(k);
        }
    }
    for (auto& layer : data->layers) {
        data->upper = std::max(data->upper, layer.cwiseAbs().rowwise().sum().maxCoeff());
        layer *= 0.5 / data->length;
    }
    FaultStiffness out;
    out.data_ = std::move(data);
    return out;
}

FaultStiffness FaultStiffness::dense(int elements, Eigen::MatrixXd matrix)
{
    const Eigen::Index rows = Eigen::Index{elements} * elements;
    if (matrix.rows() != rows || matrix.cols() != rows) {
        throw std::invalid_argument(fmt::format(
            "a fault of {0} x {0} elements needs a kernel of {1} x {1} entries, got {2} x {3}",
            elements, rows, matrix.rows(), matrix.cols()));
    }
    if (!matrix.allFinite())
        throw std::invalid_argument("the kernel has entries that are not numbers");
    const double asymmetry = (matrix - matrix.transpose()).cwiseAbs().maxCoeff();
    const double largest = matrix.cwiseAbs().maxCoeff();
    if (asymmetry > 1e-9 * largest) {
        throw std::invalid_argument(fmt::format(
            "the kernel must be symmetric: entries differ by {} from their mirror images, the "
            "largest is {}",
            asymmetry, largest));
    }
    auto data = std::make_shared<StiffnessData>();
    data->n = elements;
    data->matrix = 0.5 * (matrix + matrix.transpose());
    if (Eigen::LLT<Eigen::MatrixXd>(data->matrix).info() != Eigen::Success) {
        throw std::invalid_argument(
            "the stiffness must be positive definite: some slip would not be resisted by it");
    }
    data->upper = data->matrix.cwiseAbs().rowwise().sum().maxCoeff();
    FaultStiffness out;
    out.data_ = std::move(data);
    return out;
}

int FaultStiffness::elements() const noexcept
{
    return data_->n;
}

FaultStiffness FaultStiffness::scaled(double factor) const
{
    FaultStiffness out = *this;
    out.factor_ *= factor;
    return out;
}

namespace {

constexpr int lanczos_steps = 80;

/// The least Ritz value after Lanczos steps from a smooth start with all modes in it.
double least_ritz_value(StiffnessProduct& product)
{
    const auto size = static_cast<Eigen::Index>(product.stiffness().size());
    Eigen::VectorXd v(size);
    double phase = 0.5;
    for (Eigen::Index i = 0; i < size; ++i) {
        phase = std::fmod(phase + std::numbers::phi, 1.0);
        v[i] = 1 + 0.2 * phase;
    }
    v.normalize();
    Eigen::VectorXd before = Eigen::VectorXd::Zero(size);
    Eigen::VectorXd w(size);
    std::vector<double> diagonal;
    std::vector<double> beside;
    const double tiny = 1e-12;
    for (int step = 0; step < lanczos_steps && step < size; ++step) {
        product(v, w);
        diagonal.push_back(v.dot(w));
        w -= diagonal.back() * v;
        if (!beside.empty()) w -= beside.back() * before;
        const double norm = w.norm();
        if (norm <= tiny * std::abs(diagonal.front())) break;
        beside.push_back(norm);
        before.swap(v);
        v = w / norm;
    }
    const auto n = static_cast<Eigen::Index>(diagonal.size());
    const Eigen::Map<Eigen::VectorXd> d(diagonal.data(), n);
    const Eigen::VectorXd e = Eigen::Map<Eigen::VectorXd>(
        beside.data(), std::min<Eigen::Index>(n - 1, static_cast<Eigen::Index>(beside.size())));
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
    solver.computeFromTridiagonal(d, e, Eigen::EigenvaluesOnly);
    return solver.eigenvalues().minCoeff();
}

}  // namespace

detail::Spectrum FaultStiffness::spectrum() const
{
    const double allowance = size() == 1 ? 1 : 0.97;
    StiffnessProduct product(*this);
    const double least = least_ritz_value(product);
    if (!(least > 0)) {
        throw std::invalid_argument(fmt::format(
            "the stiffness of the fault must be positive definite, but has an eigenvalue of {}",
            least));
    }
    return {.lower = allowance * least, .upper = std::max(factor_ * data_->upper, least)};
}

Eigen::VectorXd FaultStiffness::solve(const Eigen::VectorXd& b) const
{
    constexpr double tolerance = 1e-13;
    constexpr int most = 20'000;
    StiffnessProduct product(*this);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(b.size());
    Eigen::VectorXd r = b;
    Eigen::VectorXd p = b;
    Eigen::VectorXd kp(b.size());
    double rr = r.squaredNorm();
    const double enough = tolerance * tolerance * rr;
    for (int i = 0; i < most && rr > enough; ++i) {
        product(p, kp);
        const double curvature = p.dot(kp);
        if (!(curvature > 0)) {
            throw std::invalid_argument(
                "the stiffness of the fault is not positive definite: its equations cannot be "
                "solved");
        }
        const double alpha = rr / curvature;
        x += alpha * p;
        r -= alpha * kp;
        const double next = r.squaredNorm();
        p = r + (next / rr) * p;
        rr = next;
    }
    return x;
}

// --- products ---

StiffnessProduct::StiffnessProduct(const FaultStiffness& stiffness) : stiffness_(stiffness)
{
    if (stiffness_.data_->matrix.size() == 0) {
        transforms_ = std::make_unique<detail::StiffnessTransforms>(*stiffness_.data_);
    }
}
StiffnessProduct::~StiffnessProduct() = default;
StiffnessProduct::StiffnessProduct(StiffnessProduct&&) noexcept = default;
StiffnessProduct& StiffnessProduct::operator=(StiffnessProduct&&) noexcept = default;

void StiffnessProduct::operator()(const double* x, double* y)
{
    ++count_;
    if (transforms_) return transforms_->multiply(x, y, stiffness_.factor_);
    const auto size = static_cast<Eigen::Index>(stiffness_.size());
    const Eigen::Map<const Eigen::VectorXd> from(x, size);
    Eigen::Map<Eigen::VectorXd> to(y, size);
    to.noalias() = stiffness_.factor_ * (stiffness_.data_->matrix * from);
}

// --- memory ---

namespace {

/// Number of fields of a run and of the solver, with one double for each element.
constexpr double fields = 60;

double of_run(double elements)
{
    return 8 * fields * elements * elements;
}

}  // namespace

double toeplitz_memory(double elements) noexcept
{
    // The symbol and the memory to make it, and rows of transforms.
    return of_run(elements) + 8 * (2 + 4 + 2 + 2) * elements * elements;
}

double layered_memory(double elements) noexcept
{
    return of_run(elements) + 8 * elements * elements * (elements + 10);
}

double dense_memory(double elements) noexcept
{
    // The file, the matrix, its symmetric part and its factor.
    return of_run(elements) + 8 * 4 * std::pow(elements, 4);
}

}  // namespace ricochet
