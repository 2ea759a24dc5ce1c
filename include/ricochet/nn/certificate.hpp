// Certificates: proved statements about a model, as they are stored in its file and used.
//
// A certificate states, for every state in a box and for each of its levels:
//
//     logit < threshold  implies  guard > margin,
//
// except in the boxes that a level lists as unproved. It is made by `learn/certify.hpp`. It
// contains a fingerprint of everything that it depends on (weights, threshold, normalisation,
// domain, recipe, system, parameters) and is void as soon as one of these has changed. The
// fingerprint protects against accidents, not against forgery.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/detail/classifier.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet {

/// One statement of a certificate.
struct CertificateLevel {
    double margin = 0;                              ///< in units of the guard
    double threshold = 0;                           ///< threshold of the logit
    std::uint64_t boxes = 0;                        ///< number of boxes examined
    double seconds = 0;                             ///< [s] time that the proof took
    std::vector<std::vector<Interval>> unproved{};  ///< boxes that need the exact guard
};

/// A proof that wherever a network clears, the guard of its system is above a margin.
struct Certificate {
    std::string tool;         ///< "ricochet 0.1.0"
    std::string fingerprint;  ///< of the model
    std::string system;
    std::map<std::string, double> parameters;  ///< of the system
    std::vector<Interval> box;                 ///< of raw features
    /// Margins increase, thresholds do not; the first threshold is that of the model.
    std::vector<CertificateLevel> levels;
};

/// Hash of everything that a certificate depends on, as 16 hexadecimal digits (FNV-1a, 64 bits).
[[nodiscard]] std::string fingerprint(const Model& model);

/// Text of a certificate as it is stored in a model, one line of JSON; numbers keep their bits.
[[nodiscard]] std::string to_text(const Certificate& certificate);

/// Reads a certificate from its text. @throws std::invalid_argument if it is not one.
[[nodiscard]] Certificate parse_certificate(std::string_view text);

/// Reason why the certificate of `model` does not hold for it, in words that follow "the
/// certificate"; empty if it holds.
/// @throws std::invalid_argument as `parse_certificate`.
[[nodiscard]] std::string why_void(const Model& model);

/// A model together with a certificate that holds for it.
///
/// Immutable, so threads may share it; evaluation allocates nothing.
class CertifiedClassifier {
public:
    /// @throws std::invalid_argument if the model has no certificate, or one that is void or
    /// cannot be read; as `Classifier`.
    explicit CertifiedClassifier(Model model);

    [[nodiscard]] const Classifier& classifier() const noexcept { return classifier_; }
    [[nodiscard]] const Certificate& certificate() const noexcept { return certificate_; }

    /// Whether the guard is proved to be above the first margin at these features. False outside
    /// the box, in an unproved box, and for NaN.
    [[nodiscard]] bool clears(const double* features) const noexcept;

    /// The largest margin above which the guard is proved to be; -inf if there is none.
    [[nodiscard]] double lower_bound(const double* features) const noexcept;

private:
    [[nodiscard]] bool holds(const CertificateLevel& level, double logit,
                             const double* features) const noexcept;

    Certificate certificate_;
    Classifier classifier_;
};

}  // namespace ricochet
