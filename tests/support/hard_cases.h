#pragma once

// What the tags beside some tests mean. Each names one way in which a baker goes wrong, or one
// scene whose answer is a formula; a test that carries the tag would fail if we went wrong that
// way.
//
// Openness with a closed form
//   A1   convex solids are fully open, closed rooms fully shut
//   A2   floor beside a long wall of finite height
//   A3   planes meeting at an angle; a corner of two walls
//   A4   middle of a trench
//   A5   centre of a cylindrical pit        A6   the same pit off its axis
//   A7   floor of a unit-cube pit           A8   floor beside a finite wall
//   A9   sphere above the horizon           A10  sphere resting on the floor
//   A11  anywhere in a spherical bowl
//   A12  ceiling within reach               A13  the same with falloffs
//   A14  wall within reach                  A15  the same with a linear falloff
// Geometry and rays
//   G1   light leaks through edges that triangles share
//   G2   rays aimed at vertices slip through
//   G3   secondary rays hit the surface they start from
//   G4   very small and very large scenes under- or overflow
//   G5   scenes far from the origin lose bits
//   G7   slivers report hits at absurd distances
//   G8   unwelded seams leak; they are counted, not closed
//   G9   winding turned round, and normals that are missing
//   G10  rays about a shading normal start into the surface
//   G11  rays that are not finite, or of no direction
//   G13  faces given twice weigh twice
// Environment maps
//   E1   one pixel that is no number spoils every result
//   E2   a sun is clamped away, or shows as fireflies
//   E3   values above what half floats hold become infinite
//   E4   a black map divides by its total
//   E5   maps of one texel, or of one lit texel, fall between table entries
//   E6   densities and weights that divide by zero at the poles
//   E7   the left and the right border tear apart
//   E8   a sum in float drops dim texels behind a sun
//   M1   solid angles of cube texels cancel in float
//   M2   solid angles of lat-long rows taken at their middle
//   M3   the solid angle of a small disk cancels in float
//   M4   a mirror ball is of equal area, and its whole rim one direction
//   M5   filters that stop at the faces of a cube show lines
// Reflection and harmonics
//   X1   narrow lobes overflow at their peak or cancel beside it
//   X2   directions behind the surface, and grazing ones
//   X3   rough metals lose what bounces twice between their facets
//   H1   factorials overflow at high bands
//   H2   two sign conventions are in print
//   H3   truncated harmonics ring below zero
//   H4   rotations lose or move energy
//   H5   sums over texels that are not orthonormal
// Sums and repeatability
//   R1   a running sum of floats stops growing
//   R2   variance as a difference of squares cancels
//   R3   sums that depend on how threads shared the work
//   R4   another processor takes another instruction set
//   R5   a parallel build orders the tree differently
// Samples and error bars
//   S1   unit floats that round up to 1
//   S3   a basis that degenerates at the south pole
//   S4   point counts that are no power of two waste their stratification
//   S5   higher dimensions of a point set that correlate
//   S6   neighbouring elements that share their noise
//   T1   equal samples taken for certainty
//   T2   rare bright samples that a first look misses
//   T3   error bars that do not cover the truth, or overstate it
