"""The samplers by name. Another one is a file like these and a line here."""

from collections.abc import Callable, Generator, Mapping

from savgs_ident.posterior.chains import Chains
from savgs_ident.posterior.emcee_sampler import sample_by_emcee
from savgs_ident.posterior.exact import ExactModel
from savgs_ident.posterior.keep import Keep
from savgs_ident.posterior.nuts_sampler import sample_by_nuts
from savgs_ident.posterior.result import Sampler
from savgs_ident.posterior.surrogate import Surrogate

SAMPLERS: Mapping[Sampler, Callable[[ExactModel, Surrogate, int, Keep], Generator[Chains]]] = {
    "emcee": sample_by_emcee,
    "nuts": sample_by_nuts,
}
"""Each gives chains that grow, for as long as it is asked."""
