// Choosing band limits from bounds.
//
// Sources: Ramamoorthi & Hanrahan, "A Signal-Processing Framework for Inverse Rendering", SIGGRAPH
// 2001 (reflection as convolution); Driscoll & Healy 1994 (zonal convolution multiplies bands).

#include <algorithm>
#include <cmath>

#include "core/environment/bright_light.h"
#include "core/environment/ggx_lobe.h"
#include "core/environment/near_field.h"
#include "core/environment/prefilter.h"
#include "core/sphere/harmonics.h"

namespace lightkiln {

namespace {

// Responses that matter lie below about 12 / alpha, from where only the horizon's kink is left,
// which falls as l^-2.5.
int response_count(double alpha) {
  return std::clamp(static_cast<int>(20 / alpha), 512, kMaxBands) + 1;
}

// max_{l >= L} |h_l| for every L.
std::vector<double> response_tails(const std::vector<double>& responses) {
  std::vector<double> tails = responses;
  // Beyond the kink's reach odd bands vanish: the last one says nothing of what follows it.
  double largest = std::abs(responses[responses.size() - 2]);
  for (size_t l = tails.size(); l-- > 0;) {
    largest = std::max(largest, std::abs(responses[l]));
    tails[l] = largest;
  }
  return tails;
}

int first_under(const std::vector<double>& tails, double limit) {
  for (size_t l = 1; l < tails.size(); ++l) {
    if (tails[l] <= limit) return static_cast<int>(l);
  }
  return -1;
}

// What summing the map's rows may add to a level.
constexpr double kRowShare = 0.02;  // of the target

constexpr double kSingle = 6e-8;  // what single precision may take off a value

struct BandChoice {
  int bands = 0;
  bool corrected = false;
};

// Cutting at L removes bands of the map whose squared norm is at most the map's variance, each
// times |h_l|: rms error <= max_{l>=L} |h_l| spread (Parseval). With the bright texels corrected in
// closed form, only the rest of the map is cut. A part of the target is granted to this cut; a
// smaller one without correction, since the error then gathers where the sun stands.
BandChoice choose_bands(const LightStatistics& light, const std::vector<double>& tails,
                        double target) {
  const int all = first_under(tails, 0.1 * target / light.spread);
  const int rest = first_under(tails, 0.15 * target / light.rest_spread);
  // Correction costs a term per texel and bright texel; a few more bands are cheaper.
  if (all > 0 && (light.bright.empty() || all <= rest + rest / 2 + 48)) {
    return {all, false};
  }
  if (rest > 0) return {rest, !light.bright.empty()};
  return {static_cast<int>(tails.size()) - 1, !light.bright.empty()};
}

// Interpolating the grid: band l errs by at most e_l h_l of its part of the map.
double interpolation_bound(const LightStatistics& light, const std::vector<double>& responses,
                           int bands) {
  const int rings = convolution_rings(bands), longitudes = convolution_longitudes(bands);
  double largest = 0;
  for (int l = 1; l < bands; ++l) {
    const double error = RingGrid::interpolation_error(l, rings, longitudes);
    largest = std::max(largest, error * std::abs(responses[static_cast<size_t>(l)]));
  }
  return largest * light.spread;
}

// The norm of a level, relative to the mean: by Parseval at most that of the map, and by Young's
// inequality at most that of its kernel, here squared, since the map is nowhere negative: the
// narrowest of suns cannot make more of a broad lobe.
double largest_norm(const LightStatistics& light, double kernel_squared) {
  const double mean = std::max({light.mean.x, light.mean.y, light.mean.z}) / light.mean_luminance;
  return std::min(std::hypot(mean, light.spread), mean * std::sqrt(kernel_squared));
}

// Points of the grid are kept, and interpolated from eight by eight, in single precision: 2e-7 of
// them at the most (measured: 1.5e-7). A kernel's squared norm is the sum of (2l + 1) h_l^2.
double rounding_bound(const LightStatistics& light, const std::vector<double>& responses) {
  constexpr double kRounding = 2e-7;
  double squares = 0;
  for (size_t l = 0; l < responses.size(); ++l)
    squares += (2 * static_cast<double>(l) + 1) * responses[l] * responses[l];
  return kRounding * largest_norm(light, squares);
}

// A lobe's core is left to the map's texels where its bands would be more than these: as many as
// balance a transform's cubes of bands against the texels that a core then covers.
int halo_bands(const LightStatistics& light) {
  return std::clamp(static_cast<int>(36 * std::sqrt(light.map_height)), 384, kMaxBands);
}

// The halo's bands fall like exp(-l^2 / split): the largest split whose bands beyond the limit stay
// under half the target. The core's relative error times the norm of the level, at most 1 + spread,
// takes what is left.
LobePlan plan_split(const LightStatistics& light, const Lobe& lobe, double target) {
  constexpr double kSmallestTolerance = 1e-9;
  LobePlan plan;
  plan.lobe = lobe;
  plan.bands = halo_bands(light);
  const double reserve = std::max(1.0, std::log(2 * light.spread / target));
  plan.split = double(plan.bands) * plan.bands / reserve;
  const std::vector<double> responses =
      band_responses(GgxHalo(lobe.alpha, plan.split), plan.bands + 64);
  plan.responses.assign(responses.begin(), responses.begin() + plan.bands);
  const double cut = response_tails(responses)[static_cast<size_t>(plan.bands)] * light.spread;
  plan.row_error = kRowShare * target;
  const double norm = NearField::kNormFactor * (1 + light.spread);
  plan.tolerance = std::clamp(0.4 * target / norm, kSmallestTolerance, NearField::kWorstTolerance);
  // What near_field adds is rounded once, with the level itself.
  const double peak = GgxLobe(lobe.alpha).at_angle(0);
  plan.error_bound = cut + interpolation_bound(light, responses, plan.bands) +
                     norm * plan.tolerance + plan.row_error +
                     rounding_bound(light, plan.responses) +
                     kSingle * largest_norm(light, 4 * kPi * peak);
  plan.uncorrected_bound = plan.error_bound;
  return plan;
}

}  // namespace

int convolution_rings(int bands) {
  constexpr double kRingsPerBand = 2.5;
  return std::max(64, 2 * static_cast<int>(std::ceil(kRingsPerBand * bands / 2)));
}
int convolution_longitudes(int bands) {
  constexpr double kLongitudesPerBand = 5;
  int result = 64;
  while (result < kLongitudesPerBand * bands) result *= 2;
  return result;
}

namespace {

constexpr int kDearBands = 320;

LobePlan plan_banded(const LightStatistics& light, const Lobe& lobe, double target) {
  const std::unique_ptr<ZonalKernel> kernel = make_kernel(lobe);
  const std::vector<double> responses = band_responses(*kernel, response_count(lobe.alpha));
  const std::vector<double> tails = response_tails(responses);
  BandChoice choice = choose_bands(light, tails, target);
  double phase = 0;
  const auto total_bound = [&](bool corrected) {
    const double cut =
        tails[static_cast<size_t>(choice.bands)] * (corrected ? light.rest_spread : light.spread);
    return cut + interpolation_bound(light, responses, choice.bands) + kRowShare * target +
           (corrected ? cut_light_bound(light, *kernel, responses, choice.bands, phase) : 0.0);
  };
  const auto choose_phase = [&] {
    if (!choice.corrected) return;
    phase = cut_light_phase(light, *kernel, responses, choice.bands, kPhaseShare * target);
  };
  const int most = static_cast<int>(responses.size()) - 1;
  choose_phase();
  while (total_bound(choice.corrected) > target && choice.bands < most) {
    choice.bands = std::min(most, choice.bands + choice.bands / 8 + 1);
    choose_phase();
  }
  // The part granted was small for the sake of single texels; where bands are dear, no more of them
  // are taken than the whole target asks for.
  if (total_bound(choice.corrected) <= target) {
    for (int under = kDearBands, over = choice.bands; over - under > 8;) {
      choice.bands = (under + over) / 2;
      choose_phase();
      (total_bound(choice.corrected) <= target ? over : under) = choice.bands;
      choice.bands = over;
    }
    choose_phase();
  }
  LobePlan plan;
  plan.lobe = lobe;
  plan.bands = choice.bands;
  plan.corrected = choice.corrected;
  plan.cell_phase = phase;
  plan.row_error = kRowShare * target;
  plan.responses.assign(responses.begin(), responses.begin() + choice.bands);
  const double rounding = rounding_bound(light, responses);
  plan.error_bound = total_bound(choice.corrected) + rounding;
  plan.uncorrected_bound = total_bound(false) + rounding;
  return plan;
}

}  // namespace

LobePlan plan_lobe(const LightStatistics& light, const Lobe& lobe, double target) {
  const LobePlan plan = plan_banded(light, lobe, target);
  if (plan.bands <= std::min(kSplitBands, halo_bands(light))) return plan;
  if (lobe.kind == LobeKind::charlie)
    return plan.bands <= kSplitBands ? plan : plan_banded(light, lobe, kDearTargets * target);
  return plan_split(light, lobe, target);
}

LobePlan plan_irradiance_bands(const LightStatistics& light, int bands, double target) {
  LobePlan plan;
  plan.lobe = {LobeKind::ggx, 1};
  plan.bands = bands;
  for (int l = 0; l < bands; ++l) plan.responses.push_back(clamped_cosine_band(l) / kPi);
  plan.row_error = kRowShare * target;
  plan.error_bound = plan.uncorrected_bound = interpolation_bound(light, plan.responses, bands) +
                                              plan.row_error +
                                              rounding_bound(light, plan.responses);
  plan.within_range = false;
  return plan;
}

// Parseval: the rms is the root of sum_l h_l^2 E_l / (4 pi), E_l the energy of a band. At a point a
// band of energy E_l is at most sqrt(E_l (2l+1) / (4 pi)). What the spectrum itself lacks has at
// most the map's variance left, and by Cauchy's inequality at most sqrt(sum h_l^2 (2l+1)) of it at
// a point; h_l falls as l^-2.5, so that the sum's rest is an integral.
OmittedLight omitted_irradiance(const LightStatistics& light, const LatlongSpectrum& spectrum,
                                int bands) {
  const std::vector<Vec3d> energy = band_energy(spectrum);
  OmittedLight omitted;
  for (int c = 0; c < 3; ++c) {
    double squares = 0, most = 0;
    for (int l = bands; l < spectrum.bands; ++l) {
      const double h = clamped_cosine_band(l) / kPi, e = energy[static_cast<size_t>(l)][c];
      squares += h * h * e;
      most += std::abs(h) * std::sqrt(e * (2 * l + 1) / (4 * kPi));
    }
    omitted.rms = std::max(omitted.rms, std::sqrt(squares / (4 * kPi)) / light.mean_luminance);
    omitted.most = std::max(omitted.most, most / light.mean_luminance);
  }
  constexpr double kSummed = 2048;
  double rest = 0, largest = 0;
  for (int l = spectrum.bands; l < kSummed; ++l) {
    const double h = clamped_cosine_band(l) / kPi;
    rest += h * h * (2 * l + 1);
    largest = std::max(largest, std::abs(h));
  }
  omitted.rms = std::hypot(omitted.rms, largest * light.spread);
  omitted.most += light.spread * std::sqrt(rest + 1 / (kSummed * kSummed * kSummed));
  return omitted;
}

}  // namespace lightkiln
