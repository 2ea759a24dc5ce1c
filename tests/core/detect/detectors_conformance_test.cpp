// Applies the common suite to every detector.
#include "conformance/detectors.hpp"

#include "core/detect/named_detectors.hpp"
#include "ricochet/enclosed.hpp"
#include "ricochet/gates.hpp"

namespace ricochet::test::detectors_conformance_test {
namespace {

BareNetwork network()
{
    Model model;
    model.system = "host";
    model.recipe = "state";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.layers = {{.inputs = 2, .outputs = 1, .weight = {0, 0}, .bias = {1}}};
    return BareNetwork(model);
}

template <class Detector>
DetectorCase with(const std::string& name, const Detector& detector, Evidence claims,
                  std::uint64_t most_calls)
{
    DetectorCase out = any_detector(name, detector);
    out.claims = claims;
    out.most_calls = most_calls;
    return out;
}

std::vector<DetectorCase> all()
{
    // Nothing can be proved about a host's step, which has no polynomial. Where a guard is zero at
    // an end it is evaluated at up to four other places.
    return {with("Ends", Ends{}, Evidence::assumed, 5),
            with("Extremum", Extremum{}, Evidence::checked, 61),
            with("Enclosed", Enclosed{}, Evidence::checked, 61),
            with("Bernstein", Bernstein{}, Evidence::checked, 100'000),
            // The choice of steps that it clears is tested elsewhere; this tests the other steps.
            with("Network", network(), Evidence::assumed, 6),
            with("VerifiedExtremum", Verified<Extremum>(network()), Evidence::checked, 61),
            with("VerifiedEnds", Verified<Ends>(network(), Ends{}), Evidence::assumed, 5)};
}

INSTANTIATE_TEST_SUITE_P(All, DetectorSuite, testing::ValuesIn(all()),
                         [](const auto& info) { return info.param.name; });

TEST(NamedDetectors, AreFoundByNamesOfTheirOwn)
{
    for (std::size_t i = 0; i < detail::detector_names.size(); ++i) {
        EXPECT_EQ(detail::detector_place(detail::detector_names[i]), i);
    }
    EXPECT_EQ(detail::detector_place("network"), detail::NamedDetectors::size);
    EXPECT_FALSE(detail::NamedDetectors::at(detail::NamedDetectors::size, []<class Detector>() {}));
}

TEST(NamedDetectors, AreListedByMessages)
{
    EXPECT_EQ(detail::spelled_detectors(), "extremum, ends or bernstein");
    EXPECT_EQ(detail::spelled_detectors("'"), "'extremum', 'ends' or 'bernstein'");
}

}  // namespace
}  // namespace ricochet::test::detectors_conformance_test
