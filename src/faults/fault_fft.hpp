// Complex transforms, two at a time, by Eigen's FFT module.
#pragma once

#include <complex>
#include <unsupported/Eigen/FFT>

namespace ricochet::detail {

/// Two doubles in one register, one number to Eigen's FFT: two transforms for the cost of one.
struct Pair {
    typedef double Vector __attribute__((vector_size(16)));

    Pair() = default;
    Pair(double both) : v{both, both} {}
    Pair(double first, double second) : v{first, second} {}
    explicit Pair(Vector both) : v(both) {}

    Pair& operator+=(Pair o) { return v += o.v, *this; }
    Pair& operator-=(Pair o) { return v -= o.v, *this; }
    Pair& operator*=(Pair o) { return v *= o.v, *this; }
    friend Pair operator+(Pair a, Pair b) { return Pair(a.v + b.v); }
    friend Pair operator-(Pair a, Pair b) { return Pair(a.v - b.v); }
    friend Pair operator*(Pair a, Pair b) { return Pair(a.v * b.v); }
    friend Pair operator-(Pair a) { return Pair(-a.v); }

    Vector v;
};

using ComplexPair = std::complex<Pair>;

/// Transforms of one length, without factors: forward and inverse together multiply by `length`.
class PairedTransform {
public:
    explicit PairedTransform(int length) : length_(length)
    {
        fft_.SetFlag(Eigen::FFT<Pair>::Unscaled);
    }
    void forward(ComplexPair* to, const ComplexPair* from) { fft_.fwd(to, from, length_); }
    void inverse(ComplexPair* to, const ComplexPair* from) { fft_.inv(to, from, length_); }

private:
    Eigen::FFT<Pair> fft_;
    int length_;
};

}  // namespace ricochet::detail
