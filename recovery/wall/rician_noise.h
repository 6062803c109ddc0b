// Noise of magnitude images: what it does to mean grey values, and whether an image has it.
#pragma once

#include <vector>

namespace angiospline {

// The magnitude of a complex signal of amplitude A whose two parts carry white noise of deviation
// `sigma` each is Rician distributed: no grey is negative, and where A is not well above sigma the
// mean lies above A (Rice 1944; Gudbjartsson & Patz 1995).

// The mean, sigma sqrt(pi / 2) L_1/2(-A^2 / (2 sigma^2)): 1.2533 sigma at A = 0, A + sigma^2 / (2
// A) far above sigma. Requires A >= 0, sigma > 0. Relative error below 1e-5.
double rician_mean(double amplitude, double sigma);

// The standard deviation: 0.6551 sigma at A = 0, sigma far above it.
double rician_deviation(double amplitude, double sigma);

// The amplitude whose mean this is; 0 for means below that of amplitude 0 (Koay & Basser 2006).
double rician_amplitude(double mean, double sigma);

// Greys of voxels on either side of walls, as they are in the image, and their deviations.
enum class NoiseKind { kWhite, kRician };

struct NoiseVerdict {
  NoiseKind kind = NoiseKind::kWhite;
  double sigma = 0.0;  // of each part of the signal; of white noise, of the greys
  // Log likelihood of Rician noise with one sigma for both samples, above that of white noise with
  // one deviation, or with one for each sample, whichever explains them better.
  double evidence = 0.0;
};

// Which noise explains the greys of one level inside vessels and one level outside. Rician only if
// its evidence is at least 5; white for fewer than 50 values on either side, or any negative one.
// O(values).
NoiseVerdict noise_of(const std::vector<double>& inside, const std::vector<double>& outside);

}  // namespace angiospline
