// The product with a Toeplitz stiffness by FFTW, as an option.
#pragma once

#include <fftw3.h>

#include <algorithm>
#include <cstddef>
#include <mutex>
#include <vector>

#include "stiffness_data.hpp"

namespace ricochet::detail {

/// The same product by FFTW: rows, columns, and back, omitting rows that are zero or not needed.
class FftwProduct {
public:
    explicit FftwProduct(const StiffnessData& data) : d_(data)
    {
        const int n = d_.n;
        const int m = d_.length;
        const int columns = d_.frequencies();
        const std::lock_guard lock(planning());
        spectrum_ = fftw_alloc_complex(static_cast<std::size_t>(m * columns));
        auto* field = reinterpret_cast<double*>(spectrum_);
        to_rows_ = fftw_plan_many_dft_r2c(1, &m, n, field, nullptr, 1, 2 * columns, spectrum_,
                                          nullptr, 1, columns, FFTW_ESTIMATE);
        from_rows_ = fftw_plan_many_dft_c2r(1, &m, n, spectrum_, nullptr, 1, columns, field,
                                            nullptr, 1, 2 * columns, FFTW_ESTIMATE);
        const auto along = [&](int sign) {
            return fftw_plan_many_dft(1, &m, columns, spectrum_, nullptr, columns, 1, spectrum_,
                                      nullptr, columns, 1, sign, FFTW_ESTIMATE);
        };
        forward_ = along(FFTW_FORWARD);
        inverse_ = along(FFTW_BACKWARD);
        arrange_symbol();
    }
    ~FftwProduct()
    {
        const std::lock_guard lock(planning());
        for (fftw_plan plan : {to_rows_, from_rows_, forward_, inverse_}) fftw_destroy_plan(plan);
        fftw_free(spectrum_);
    }
    FftwProduct(const FftwProduct&) = delete;
    FftwProduct& operator=(const FftwProduct&) = delete;

    void multiply(const double* x, double* y, double factor)
    {
        const auto n = static_cast<std::size_t>(d_.n);
        const std::size_t stride = 2 * static_cast<std::size_t>(d_.frequencies());
        auto* field = reinterpret_cast<double*>(spectrum_);
        std::fill_n(field, stride * static_cast<std::size_t>(d_.length), 0.0);
        for (std::size_t i = 0; i < n; ++i) std::copy_n(x + i * n, n, field + i * stride);
        fftw_execute(to_rows_);
        fftw_execute(forward_);
        for (std::size_t i = 0; i < symbol_.size(); ++i) {
            spectrum_[i][0] *= symbol_[i];
            spectrum_[i][1] *= symbol_[i];
        }
        fftw_execute(inverse_);
        fftw_execute(from_rows_);
        for (std::size_t i = 0; i < n; ++i) {
            for (std::size_t j = 0; j < n; ++j) y[i * n + j] = factor * field[i * stride + j];
        }
    }

private:
    void arrange_symbol()
    {
        const auto rows = static_cast<std::size_t>(d_.length);
        const auto columns = static_cast<std::size_t>(d_.frequencies());
        symbol_.resize(rows * columns);
        for (std::size_t i = 0; i < rows; ++i) {
            for (std::size_t k = 0; k < columns; ++k) {
                // The symbol of the paired transforms is for doubled spectra.
                symbol_[i * columns + k] = 2 * d_.symbol[(k - k % 2) * rows + 2 * i + k % 2];
            }
        }
    }

    /// FFTW makes plans one at a time.
    static std::mutex& planning()
    {
        static std::mutex mutex;
        return mutex;
    }

    const StiffnessData& d_;
    fftw_complex* spectrum_ = nullptr;
    fftw_plan to_rows_{}, from_rows_{}, forward_{}, inverse_{};
    std::vector<double> symbol_;
};

}  // namespace ricochet::detail
